"""Estimates of a drive that is going on equal those of a replay of its frames."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import clutchest
from clutchest.can.files import read_frames
from clutchest.can.frames import Frames
from clutchest.monitor.live import LiveEstimator
from clutchest.reading.log import load_database
from clutchest.shipped import locate

DATA = Path(__file__).parents[2].parent / "shared" / "data"


def frames_of(log, seconds=np.inf) -> Frames:
    frames = read_frames(locate(str(log), "logs")).sorted()
    t = frames.t_ns.copy()
    for k in range(1, len(t)):  # as a monitor stamps them: no two alike
        t[k] = max(t[k], t[k - 1] + 1000)
    frames.t_ns[:] = t
    return frames.take(t - t[0] < seconds * 1e9)


def live(vehicle, frames, batches, **more):
    """All pieces of a drive whose frames taken in ``batches`` (indices at which one ends)."""
    pieces, taken = [], 0

    def history():
        return frames.take(np.arange(taken))

    drive = LiveEstimator(vehicle, load_database(vehicle, [DATA]), history=history, **more)
    for a, b in zip([0, *batches], [*batches, len(frames)], strict=True):
        part, taken = frames.take(np.arange(a, b)), b
        if a and b > a:  # what a monitor sees of a silence: nothing, again and again
            for now in range(int(frames.t_ns[a - 1]), int(part.t_ns[0]), 700_000_000):
                pieces.append(drive.take(Frames.empty(), now))
        if len(part):
            pieces.append(drive.take(part, int(part.t_ns[-1])))
    pieces.append(drive.finish())
    return [p for p in pieces if p is not None], drive


def replayed(vehicle, frames, tmp_path, **more):
    from clutchest.can.files import write_frames

    path = tmp_path / "received.log"
    write_frames(frames, path)
    return clutchest.replay(clutchest.read_log(path, vehicle), vehicle, **more)


def assert_same(pieces, run):
    """Every estimate within 1e-9 of its standard deviation, every mode and slip event the same."""
    begin = max(k for k, p in enumerate(pieces) if p.begins)
    tracks, (whole,) = [p.track for p in pieces[begin:]], run.tracks

    def joined(of):
        return np.concatenate([of(track) for track in tracks])

    assert np.array_equal(joined(lambda t: t.time), whole.time)
    assert np.array_equal(joined(lambda t: t.mode), whole.mode)
    for name, expected in whole.states.items():
        value = joined(lambda t, n=name: t.states[n].value)
        std = joined(lambda t, n=name: t.states[n].std)
        if np.isfinite(expected.value).any():
            scale = np.maximum(np.abs(expected.value), expected.std)
            assert np.all(np.abs(value - expected.value) <= 1e-9 * scale), name
            assert np.all(np.abs(std - expected.std) <= 1e-9 * expected.std), name
    torque = joined(lambda t: t.clutch_torque.value)
    assert np.allclose(torque, whole.clutch_torque.value, rtol=1e-9, atol=1e-9, equal_nan=True)
    z = joined(lambda t: t.innovations.innovation)
    assert len(z) == len(whole.innovations.innovation)
    assert sum((t.engagements for t in tracks), ()) == whole.engagements


@pytest.mark.parametrize("seed", range(3))
def test_a_truck(seed, tmp_path):
    truck = clutchest.load_vehicle("truck")
    frames = frames_of("demo", 60.0)
    rng = np.random.default_rng(seed)
    batches = np.unique(rng.integers(0, len(frames), [15, 60, 300][seed])).tolist()
    pieces, drive = live(truck, frames, batches)
    run = replayed(truck, frames, tmp_path)
    assert_same(pieces, run)
    assert drive.final()["x"] == pytest.approx(run.final["x"], rel=1e-9)


LAZY = """
from clutchest.models.effects import Effect, Lateness, Number

class Lazy(Effect):
    name, model, equation = "lazy", "dry_clutch", "timing:engine_torque"
    parameters = (Number("size", "1", 0.0, 2.0),)
    delays = {"engine_torque": "size"}
    lateness = {"engine_torque": Lateness("engine_speed", (60.0, 130.0), (0.3, -0.05))}
"""


def test_a_report_that_is_late_by_turns(tmp_path):
    (tmp_path / "lazy.py").write_text(LAZY)
    truck = replace(
        clutchest.load_vehicle("truck"),
        effects={"lazy": {"size": 1.0}},
        effects_files=(tmp_path / "lazy.py",),
    )
    frames = frames_of("demo", 60.0)
    batches = np.unique(np.random.default_rng(6).integers(0, len(frames), 60)).tolist()
    pieces, _ = live(truck, frames, batches)
    assert_same(pieces, replayed(truck, frames, tmp_path))


def without(frames, start, stop, *ids):
    """Frames without those of some ids (all, if none is named) from ``start`` to ``stop`` s."""
    t = (frames.t_ns - frames.t_ns[0]) / 1e9
    named = np.isin((frames.id >> 8) & 0xFFFF, ids) if ids else np.ones(len(t), bool)
    return frames.take(~(named & (t >= start) & (t < stop)))


EEC1, ETC1, ACTUATOR, ET1, AMB = 0xF004, 0xF002, 0xFF10, 0xFEEE, 0xFEF5


@pytest.mark.parametrize(
    "change",
    [
        lambda f: without(without(f, 8, 9.5, EEC1), 30, 31, ETC1),
        lambda f: without(without(f, 12.2, 27.7, EEC1), 40, 55),
        lambda f: without(without(f, 14, 26, ACTUATOR), 44, 60, ETC1),
        lambda f: without(without(f, 0, 21, AMB), 0, 34, ET1),
        lambda f: without(f, 0, 7.7, EEC1),
        lambda f: without(f, 20, 99, ACTUATOR),
    ],
    ids=["short holes", "long holes", "one node away", "late signals", "a late engine", "lost"],
)
def test_holes(change, tmp_path):
    truck, frames = clutchest.load_vehicle("truck"), change(frames_of("demo", 70.0))
    rng = np.random.default_rng(4)
    cuts = np.unique(rng.integers(0, len(frames), 60))
    pieces, _ = live(truck, frames, cuts.tolist())
    assert_same(pieces, replayed(truck, frames, tmp_path))


def delivered(frames, start, stop):
    """Frames as a bus brings them that stands still from ``start`` to ``stop`` s: what was sent
    meanwhile is delivered at once, and stamped so."""
    after = (frames.t_ns - frames.t_ns[0]) / 1e9
    t = np.where((after >= start) & (after < stop), frames.t_ns[0] + int(stop * 1e9), frames.t_ns)
    place = 1000 * np.arange(len(t))
    frames.t_ns[:] = np.maximum.accumulate(t - place) + place
    return frames


@pytest.mark.parametrize(
    "change",
    [
        pytest.param(lambda f: delivered(f, 1.3, 4.8), marks=pytest.mark.slow),
        lambda f: without(f, 0.5, 8.0),
        lambda f: delivered(delivered(f, 11.0, 15.7), 20.0, 21.5),
    ],
    ids=["while sampling is determined", "nothing at first", "while driving"],
)
def test_a_bus_that_stands_still(change, tmp_path):
    """Samples microseconds apart, and a beginning that is known but for a moment."""
    truck, frames = clutchest.load_vehicle("truck"), change(frames_of("demo", 30.0))
    t = (frames.t_ns - frames.t_ns[0]) / 1e9
    cuts = np.unique(np.searchsorted(t, np.arange(0.02, 30.0, 0.033)))
    pieces, _ = live(truck, frames, cuts[cuts < len(t)].tolist())
    assert_same(pieces, replayed(truck, frames, tmp_path))


def test_a_spike_of_what_is_held(tmp_path):
    """One wrong coolant temperature, which cannot be recognised before the next one."""
    truck, frames = clutchest.load_vehicle("truck"), frames_of("demo", 20.0)
    coolant = np.flatnonzero(((frames.id >> 8) & 0xFFFF) == ET1)
    frames.data[coolant[len(coolant) // 2], 0] = 240
    cuts = np.arange(0, len(frames), 40)[1:].tolist()
    pieces, _ = live(truck, frames, cuts)
    assert_same(pieces, replayed(truck, frames, tmp_path))


@pytest.mark.parametrize("silence", [4.0, 12.0, 25.0])
def test_the_end_of_a_silence(silence, tmp_path):
    """A session that ends while the bus says nothing has all that a replay has."""
    truck, frames = clutchest.load_vehicle("truck"), frames_of("demo", 20.0)
    drive = LiveEstimator(truck, load_database(truck))
    last = int(frames.t_ns[-1])
    pieces = [drive.take(frames, last)]
    for now in np.arange(0.25, silence, 0.25):
        pieces.append(drive.take(Frames.empty(), last + int(now * 1e9)))
    pieces.append(drive.finish())
    time = np.concatenate([p.track.time for p in pieces if p])
    whole = replayed(truck, frames, tmp_path).tracks[0]
    before = whole.time < whole.time[-1] - 0.5  # how a silence begins, nobody can tell of a log
    assert np.array_equal(time[: len(whole.time)], whole.time)
    assert time[-1] >= whole.time[-1] + (silence - 0.5 if silence > 10.0 else 0.0)
    for name, expected in whole.states.items():
        value = np.concatenate([p.track.states[name].value for p in pieces if p])
        assert np.array_equal(value[: len(before)][before], expected.value[before]), name


@pytest.mark.skipif(not DATA.is_dir(), reason="the real logs are not on this machine")
@pytest.mark.parametrize(
    ("vehicle", "log"), [("gt350", "gt350_launch.trc"), ("j1939_t270", "j1939_t270_drive.log")]
)
def test_real_drives(vehicle, log, tmp_path, monkeypatch):
    """Inferred gears, a shuffling driveline, several senders, signals that taken late."""
    monkeypatch.chdir(DATA)  # its DBC does not travel with the package
    car, frames = clutchest.load_vehicle(vehicle), frames_of(DATA / log)
    rng = np.random.default_rng(1)
    pieces, _ = live(car, frames, np.unique(rng.integers(0, len(frames), 80)).tolist())
    assert_same(pieces, replayed(car, frames, tmp_path))


@pytest.mark.slow
def test_a_differential(tmp_path):
    rig, frames = clutchest.load_vehicle("alsd_rig"), frames_of("alsd")
    rng = np.random.default_rng(2)
    pieces, _ = live(rig, frames, np.unique(rng.integers(0, len(frames), 12)).tolist())
    assert_same(pieces, replayed(rig, frames, tmp_path))


def test_a_wrong_number_of_teeth_is_named_while_the_drive_lasts(tmp_path):
    truck, frames = clutchest.load_vehicle("truck"), frames_of("demo", 70.0)
    shaft = np.flatnonzero(((frames.id >> 8) & 0xFFFF) == ETC1)
    raw = frames.data[shaft, 5] + 256.0 * frames.data[shaft, 6]
    fewer = np.where(raw < 0xFB00, np.round(raw * 58.0 / 60.0), raw).astype(np.uint16)
    frames.data[shaft, 5], frames.data[shaft, 6] = fewer & 255, fewer >> 8
    cuts = np.searchsorted(frames.t_ns - frames.t_ns[0], np.arange(1.0, 70.0) * 1e9)
    pieces, drive = live(truck, frames, cuts.tolist())
    found = pieces[-1].track.contradiction
    assert found.kind == "ratio" and "number of teeth" in found.explanation
    assert (
        found.explanation == replayed(truck, frames, tmp_path).tracks[0].contradiction.explanation
    )
    for piece in pieces:
        after = piece.track.time >= found.since_s
        assert not any(state.valid[after].any() for state in piece.track.states.values())
    assert drive.final()["contradiction"] == found.words
