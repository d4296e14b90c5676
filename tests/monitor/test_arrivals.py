"""Estimates equal a replay's however frames arrive: in bursts, late, after silences; and whenever
the session ends."""

from dataclasses import replace

import numpy as np
import pytest

import clutchest
from clutchest.can.bus import Received
from clutchest.can.files import read_frames, write_frames
from clutchest.can.frames import Frames
from clutchest.monitor.live import LiveEstimator
from clutchest.monitor.monitor import TICK_S
from clutchest.monitor.reception import TRANSIT_NS
from clutchest.monitor.stamps import Stamps
from clutchest.reading import load_database
from clutchest.shipped import locate

EPOCH = 1_700_000_000_000_000_000


def standing(at, rng, most):
    """Times ``at`` of which those within some stretches move to the stretch's end."""
    for _ in range(rng.integers(0, most)):
        begin, long = rng.uniform(0.0, at[-1]), rng.choice([0.5, 1.2, 2.0, 4.7, 9.8, 12.0])
        at = np.where((at >= begin) & (at < begin + long), begin + long, at)
    return np.maximum.accumulate(at)


def received_live(truck, frames, rng):
    """Pieces of a drive whose sender, bus and listener pause now and then, the frames as they were
    stamped, and up to when, s, the drive was known to go on in the end."""
    t = (frames.t_ns - frames.t_ns[0]) / 1e9
    sent = standing(t, rng, 4)
    for _ in range(rng.integers(0, 3)):  # a sender that stops for a while
        sent = sent + rng.choice([0.5, 5.0, 11.0]) * (sent >= rng.uniform(0.0, sent[-1]))
    sent += 1e-6 * np.arange(len(sent))
    handed = standing(sent, rng, 6)
    end = handed[-1] + rng.choice([0.1, 2.0, 9.0, 15.0, 30.0])
    now, taken, used, pieces = 0.0, 0, [], []
    stamps = Stamps(lambda: int(now * 1e9), lambda: EPOCH)
    live = LiveEstimator(truck, load_database(truck), history=lambda: Frames.concatenate(used))
    while now < end:
        now = min(now + rng.exponential(0.05), end)
        if taken == len(handed) or handed[taken] > now:
            now = min(now + TICK_S, end)
        upto = int(np.searchsorted(handed, now, side="right"))
        if upto > taken:
            raw = EPOCH + (1e9 * sent[taken:upto]).astype(np.int64)
            part = replace(frames.take(np.arange(taken, upto)), t_ns=raw)
            used.append(stamps.used(Received(part, int(now * 1e9), 0)))
            pieces.append(live.take(used[-1], int(used[-1].t_ns[-1])))
            taken = upto
        elif used:
            pieces.append(live.take(Frames.empty(), stamps.promised(int(now * 1e9) - TRANSIT_NS)))
    pieces.append(live.finish())
    received = Frames.concatenate(used)
    until = max(stamps.promised(int(now * 1e9) - TRANSIT_NS), received.t_ns[-1]) - received.t_ns[0]
    return [p for p in pieces if p], received, until / 1e9


@pytest.mark.parametrize(
    "seed", [pytest.param(n, marks=() if n in (2, 4) else pytest.mark.slow) for n in range(6)]
)
def test_however_frames_arrive(seed, tmp_path):
    truck, rng = clutchest.load_vehicle("truck"), np.random.default_rng(seed)
    log = read_frames(locate("demo", "logs")).sorted()
    t = (log.t_ns - log.t_ns[0]) / 1e9
    begin = rng.uniform(0.0, 200.0)
    frames = log.take((t >= begin) & (t < begin + 15.0))
    pieces, received, until = received_live(truck, frames, rng)
    write_frames(received, tmp_path / "received.log")
    signals = clutchest.read_log(tmp_path / "received.log", truck)
    last = max(k for k, p in enumerate(pieces) if p.begins)
    tracks = [p.track for p in pieces[last:]]
    time = np.concatenate([x.time for x in tracks])
    if time[-1] > signals.end:  # frames do not show a silence after them: a replay gets its end
        signals = replace(signals, end=until)
    (whole,) = clutchest.replay(signals, truck).tracks
    assert np.array_equal(time, whole.time)
    mode = np.concatenate([x.mode for x in tracks])
    assert np.array_equal(mode, whole.mode)
    for name, expected in whole.states.items():
        value = np.concatenate([x.states[name].value for x in tracks])
        off = np.abs(value - expected.value)
        assert np.all((off <= 1e-9 * expected.std) | np.isnan(off)), name
