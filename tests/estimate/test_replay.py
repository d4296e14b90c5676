"""Replay end to end on drives of the independent generator."""

import json
from dataclasses import replace

import numpy as np
import pytest

import clutchest
from clutchest.can.decode import rows_of
from clutchest.can.files import read_frames, write_frames
from clutchest.errors import ClutchestError
from clutchest.estimate import whole_log
from clutchest.estimate.track import SMALLEST
from clutchest.reading import load_database
from clutchest.record.files import write_run
from clutchest.shipped import locate
from clutchest.signals import Signal, Signals

TRUCK = clutchest.load_vehicle("truck")
STATES = (
    "temp_body",
    "temp_housing",
    "temp_disc",
    "zero_position",
    "friction",
    "engine_speed",
    "torque_bias",
    "wear_rate",
)


def error(run, truth, name):
    """(estimate − truth, std) of a state on the output grid."""
    track = run.tracks[0]
    estimate = track.states[name]
    return estimate.value - np.interp(track.time, truth.time, truth.columns[name]), estimate.std


@pytest.fixture(scope="module")
def drives():
    """Launches of ten minutes: parameters, start and noise drawn by the seed."""
    signals = [clutchest.simulate(TRUCK, "launches", seed, duration=600.0) for seed in range(6)]
    return [(s, clutchest.replay(s, TRUCK)) for s in signals]


@pytest.mark.parametrize("name", STATES)
def test_the_truth_lies_within_the_stated_uncertainty(drives, name):
    inside = [np.abs(e) < 1.96 * std for e, std in (error(r, s.truth, name) for s, r in drives)]
    assert np.mean(inside) >= 0.90
    # and the uncertainty is no excuse: it shrinks to something of use, but ten minutes are too
    # short to tell a rate of wear
    known = [run.summary["states"][name]["valid"] for _, run in drives]
    assert all(known) if name != "wear_rate" else not any(known)


def test_torque_while_slipping(drives):
    for signals, run in drives:
        track, truth = run.tracks[0], signals.truth
        row = np.clip(np.searchsorted(truth.time, track.time), 0, len(truth.time) - 1)
        slipping = truth.columns["mode"][row] == "slipping"
        wrong = track.clutch_torque.value - np.interp(
            track.time, truth.time, truth.columns["clutch_torque"]
        )
        assert np.sqrt(np.mean(wrong[slipping] ** 2)) < 0.03 * 3500  # [ME15]'s three per cent


def test_a_closed_clutch_carries_what_the_engine_gives():
    """Not what its surfaces could carry, thousands of Nm more, whatever noise makes of its slip."""
    signals = {name: replace(s, noise_ar=0.9) for name, s in TRUCK.signals.items()}
    truck = replace(TRUCK, signals=signals)
    for seed in (0, 1):
        drive = clutchest.simulate(truck, "city", seed, duration=300.0, noise_ar=0.9)
        track, truth = clutchest.replay(drive, truck).tracks[0], drive.truth
        wrong = track.clutch_torque.value - np.interp(
            track.time, truth.time, truth.columns["clutch_torque"]
        )
        assert np.abs(wrong).max() < 350.0


def test_slip_events_and_their_energy(drives):
    for signals, run in drives:
        truth = signals.truth
        energy = truth.columns["slip_energy"]
        found = run.summary["engagements"]
        launches = [e for e in found if e["energy_J"] > 10e3]
        assert len(launches) >= 8
        for event in launches:
            a, b = event["start_s"], event["start_s"] + event["duration_s"]
            true = np.interp(b + 0.1, truth.time, energy) - np.interp(a - 0.1, truth.time, energy)
            assert abs(event["energy_J"] - true) < 4 * event["energy_std_J"] + 500
        track = run.tracks[0]
        assert abs(track.slip_energy.value[-1] - energy[-1]) < 4 * track.slip_energy.std[-1]


def test_modes_agree_with_the_truth(drives):
    for signals, run in drives:
        track, truth = run.tracks[0], signals.truth
        row = np.clip(np.searchsorted(truth.time, track.time), 0, len(truth.time) - 1)
        mine = np.array(track.mode_names)[track.mode]
        # the two know lock-up and settling to a few tenths of a second
        assert np.mean(mine == truth.columns["mode"][row]) > 0.95


def test_innovations_of_the_zero_position_lie_between_average_and_noise(drives):
    """No average of 17 readings is better than white noise leaves it, or worse than it is held."""
    noise = TRUCK.signals["slave_position"].noise
    sizes = [run.summary["sensors"]["zero_position"]["innovation_rms"] for _, run in drives]
    assert 1 / np.sqrt(17) < np.mean(sizes) / noise < 1.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effects", "state", "shift"),
    [
        ({"wear": {"amount": 0.6}}, "zero_position", -0.6),
        ({"friction_level": {"change": -0.2}}, "friction", -0.2),
    ],
)
def test_wear_and_friction_are_followed(effects, state, shift):
    for seed in range(3):
        plain = clutchest.simulate(TRUCK, "launches", seed, duration=600.0)
        signals = clutchest.simulate(TRUCK, "launches", seed, effects, duration=600.0)
        run = clutchest.replay(signals, TRUCK)
        wrong, std = error(run, signals.truth, state)
        assert abs(wrong[-1]) < 3 * std[-1]
        moved = run.tracks[0].states[state].value[-1]
        moved -= clutchest.replay(plain, TRUCK).tracks[0].states[state].value[-1]
        assert moved == pytest.approx(shift, abs=0.15 * abs(shift))


@pytest.mark.slow
def test_half_an_hour_without_slip_informs_no_friction():
    signals = clutchest.simulate(TRUCK, "closed", 1)
    run = clutchest.replay(signals, TRUCK)
    friction = run.tracks[0].states["friction"]
    assert np.abs(friction.value - 1.0).max() < 1e-6  # nothing wanders
    assert (np.diff(friction.std) > -1e-9).all()  # nothing grows surer
    told = run.summary["states"]["friction"]
    assert not told["valid"]
    assert "launch" in told["needs"]


def test_a_log_in_pieces_gives_the_same_answer(drives, monkeypatch):
    signals, whole = drives[0]
    monkeypatch.setattr(whole_log, "CHUNK", 10_007)
    pieces = clutchest.replay(signals, TRUCK)
    for name in STATES:
        a, b = whole.tracks[0].states[name], pieces.tracks[0].states[name]
        assert np.array_equal(a.value, b.value)
        assert np.array_equal(a.std, b.std)
    assert np.array_equal(whole.tracks[0].slip_energy.value, pieces.tracks[0].slip_energy.value)


def test_a_drive_in_stretches_is_the_whole_drive(monkeypatch):
    """Filtered a stretch at a time, or at once as the smoother needs it: the same to the last
    bit, sums over the whole log but for their rounding."""
    monkeypatch.setattr("clutchest.estimate.replay.STRETCH", 17.0)
    signals = clutchest.read_log("demo", "truck")
    parts = clutchest.replay(signals, "truck")
    whole = clutchest.replay(signals, "truck", smooth=True)
    (a,), (b,) = parts.tracks, whole.tracks
    for name, estimate in b.states.items():
        for column in ("value", "std", "valid"):
            np.testing.assert_array_equal(
                getattr(a.states[name], column), getattr(estimate, column)
            )
    for name in ("time", "mode"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
    for name in ("time", "sensor", "innovation", "std"):
        np.testing.assert_array_equal(getattr(a.innovations, name), getattr(b.innovations, name))
    np.testing.assert_array_equal(a.information.bits, b.information.bits)
    assert a.engagements == b.engagements and len(a.engagements) == 4
    assert parts.final == whole.final
    told = dict(parts.summary)
    assert told.pop("log_likelihood") == pytest.approx(whole.summary["log_likelihood"], rel=1e-12)
    assert told == {key: whole.summary[key] for key in told}


def test_slips_that_wide_parameters_leave_open_are_said(monkeypatch):
    """Of a kiss point known to a millimetre, whether torque passes is open in some slips; all of
    them are counted, whether filtered at once or in stretches."""
    kiss = replace(TRUCK.parameters["kiss_point"], spread=1.0, source="guess: another's")
    wide = replace(TRUCK, parameters={**TRUCK.parameters, "kiss_point": kiss})
    signals = clutchest.read_log("demo", TRUCK)
    every = clutchest.replay(signals, TRUCK).tracks[0].engagements
    told = clutchest.replay(signals, wide)
    (track,) = told.tracks
    assert track.uncertain_slips
    starts = [e.start_s for e in (*track.engagements, *track.uncertain_slips)]
    assert sorted(starts) == pytest.approx([e.start_s for e in every], abs=0.05)
    open_slips = told.summary["uncertain_slips"]
    assert all(SMALLEST < e["energy_J"] < e["energy_std_J"] for e in open_slips)
    assert f"not listed: {len(open_slips)} slip event" in told.summary["warnings"][0]
    assert list(told.summary["slip_energy_std_from_J"]) == ["kiss_point"]
    monkeypatch.setattr("clutchest.estimate.replay.STRETCH", 17.0)
    assert clutchest.replay(signals, wide).tracks[0].uncertain_slips == track.uncertain_slips


def test_outliers_do_little_harm():
    signals = clutchest.simulate(TRUCK, "launches", 3, duration=600.0, outliers=0.02)
    run = clutchest.replay(signals, TRUCK)
    for name in STATES:
        wrong, std = error(run, signals.truth, name)
        assert np.mean(np.abs(wrong) < 1.96 * std) >= 0.9, name


def shifted(signals: Signals, seconds: float) -> Signals:
    """The same drive that many seconds later."""
    return replace(signals, start_ns=signals.start_ns + round(seconds * 1e9))


def until(signal, end):
    """The samples up to ``end`` s."""
    keep = signal.time < end
    return signal.take(keep)


def after(signal, start):
    """The samples from ``start`` s on, counted from there."""
    keep = signal.time >= start
    return replace(
        signal, time=signal.time[keep] - start, value=signal.value[keep], why=signal.why[keep]
    )


class TestCarryingOver:
    """``state.json``: from one drive to the next."""

    def test_a_night_in_the_yard(self, drives):
        signals, first = drives[0]
        final = json.loads(json.dumps(first.final))
        second = clutchest.replay(shifted(signals, 12 * 3600.0), TRUCK, state=final)
        before, after = first.tracks[0].states, second.tracks[0].states
        zero = "zero_position"
        assert after[zero].value[0] == pytest.approx(before[zero].value[-1], abs=1e-3)
        assert after[zero].std[0] < 1.05 * before[zero].std[-1]
        assert after["friction"].std[0] < 1.05 * before["friction"].std[-1]
        assert second.tracks[0].slip_energy.value[0] == pytest.approx(
            first.tracks[0].slip_energy.value[-1]
        )

    def test_temperatures_relax_over_minutes_and_settle_over_days(self, drives):
        signals, first = drives[0]
        hot = first.tracks[0].states["temp_body"].value[-1]
        run = {
            seconds: clutchest.replay(shifted(signals, 600.0 + seconds), TRUCK, state=first.final)
            for seconds in (10.0, 900.0, 40 * 86400.0)
        }
        start = {s: r.tracks[0].states["temp_body"].value[0] for s, r in run.items()}
        rest = clutchest.replay(signals, TRUCK).tracks[0].states["temp_body"].value[0]
        assert start[10.0] == pytest.approx(hot, abs=1.5)
        assert abs(start[900.0] - rest) < abs(hot - rest)
        assert start[40 * 86400.0] == pytest.approx(rest, abs=1.0)

    def test_without_a_clock_only_wear_and_friction_carry_over(self, drives):
        signals, first = drives[0]
        run = clutchest.replay(replace(signals, start_ns=None), TRUCK, state=first.final)
        fresh = clutchest.replay(replace(signals, start_ns=None), TRUCK)
        a, b = run.tracks[0].states, fresh.tracks[0].states
        assert a["temp_body"].std[0] == pytest.approx(b["temp_body"].std[0])
        assert a["zero_position"].std[0] < 0.5 * b["zero_position"].std[0]
        assert any("no absolute time" in warning for warning in run.summary["warnings"])

    def test_drives_out_of_order_are_refused(self, drives):
        signals, first = drives[0]
        with pytest.raises(ClutchestError, match="order of time"):
            clutchest.replay(shifted(signals, -3600.0), TRUCK, state=first.final)

    @pytest.mark.parametrize(
        ("key", "value", "words"),
        [
            ("vehicle", "bus", "of vehicle 'bus'"),
            ("states", ["temp_bodie"], "none of the states"),
            ("P", None, "has no P"),
        ],
    )
    def test_a_foreign_state_is_refused(self, drives, key, value, words):
        signals, first = drives[0]
        final = {k: v for k, v in first.final.items() if k != key}
        if value is not None:
            final[key] = value
        with pytest.raises(ClutchestError, match=words):
            clutchest.replay(shifted(signals, 7200.0), TRUCK, state=final)

    def test_the_uncertainty_of_the_energy_carries_over(self, drives):
        signals, whole = drives[0]
        half = 300.0
        first = replace(signals, signals={n: until(s, half) for n, s in signals.items()}, end=half)
        second = replace(
            signals, signals={n: after(s, half) for n, s in signals.items()}, end=signals.end - half
        )
        state = json.loads(json.dumps(clutchest.replay(first, TRUCK).final))
        joined = clutchest.replay(shifted(second, half), TRUCK, state=state).tracks[0].slip_energy
        entire = whole.tracks[0].slip_energy
        assert joined.value[-1] == pytest.approx(entire.value[-1], rel=0.01)
        assert joined.std[-1] == pytest.approx(entire.std[-1], rel=0.1)

    @pytest.mark.slow
    def test_states_are_matched_by_name(self, drives):
        signals, first = drives[0]
        played = replace(TRUCK, effects={"position_hysteresis": {"play": 0.01}})
        later = shifted(signals, 7200.0)
        gained = clutchest.replay(later, played, state=first.final)
        before = first.tracks[0].states["zero_position"].value[-1]
        assert gained.tracks[0].states["zero_position"].value[0] == pytest.approx(before, abs=1e-3)
        lost = clutchest.replay(shifted(signals, 14400.0), TRUCK, state=gained.final)
        assert set(lost.tracks[0].states) == set(STATES)

    def test_several_drives_in_one_call_are_carried_on(self, drives):
        signals = drives[0][0]
        both = replace(signals, later=(shifted(signals, 7200.0),))
        run = clutchest.replay(both, TRUCK)
        chained = clutchest.replay(shifted(signals, 7200.0), TRUCK, state=drives[0][1].final)
        for name in STATES:
            a, b = run.tracks[1].states[name], chained.tracks[0].states[name]
            assert np.array_equal(a.value, b.value)
        frame = run.to_pandas()
        assert list(frame["drive"].unique()) == [0, 1]


class TestEffectsInTheVehicleFile:
    """What the file says of an effect stands in the model."""

    @pytest.fixture(scope="class")
    @staticmethod
    def weak():
        """A drive whose clutch has lost a fifth of its torque and whose engine torque is late."""
        effects = {"friction_level": {"change": -0.2}, "torque_delay": {"delay": 0.08}}
        signals = clutchest.simulate(TRUCK, "launches", 5, effects, duration=400.0)
        return signals, replace(TRUCK, effects=effects)

    def test_the_same_effects_in_the_file_explain_the_drive(self, weak):
        signals, knowing = weak
        told, untold = clutchest.replay(signals, knowing), clutchest.replay(signals, TRUCK)
        friction = told.summary["states"]["friction"]
        assert abs(friction["value"] - 1.0) < 3 * friction["std"]
        assert told.summary["log_likelihood"] > untold.summary["log_likelihood"] + 10

    @pytest.mark.slow
    def test_an_effect_of_the_users_own(self, weak, tmp_path):
        file = tmp_path / "glazing.py"
        file.write_text(
            "from clutchest.models.effects import Effect, Number\n"
            "class Glazing(Effect):\n"
            "    '''Torque less by a share.'''\n"
            "    name, model, equation = 'glazing', 'dry_clutch', 'torque'\n"
            "    parameters = (Number('share', '1', 0.0, 0.5),)\n"
            "    def terms(self, g):\n"
            "        return {'sliding_torque': lambda torque, q: torque * (1 - g.share)}\n"
        )
        signals, knowing = weak
        own = replace(
            knowing,
            effects={"glazing": {"share": 0.2}, "torque_delay": {"delay": 0.08}},
            effects_files=(file,),
        )
        a = clutchest.replay(signals, own).tracks[0].states["friction"]
        b = clutchest.replay(signals, knowing).tracks[0].states["friction"]
        assert np.allclose(a.value, b.value, rtol=1e-9)

    def test_an_unknown_effect_is_refused(self, weak):
        signals, knowing = weak
        with pytest.raises(ClutchestError, match="did you mean 'friction_level'"):
            clutchest.replay(signals, replace(knowing, effects={"friction_lvl": {"change": 0.1}}))


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("x", [1.0, 2.0]),
        ("x", ["a"] * 7),
        ("x", [None] * 7),
        ("P", [[1.0]]),
        ("P", (-np.eye(7)).tolist()),
        ("signature", [[1.0]]),
        ("thetas", 3),
        ("inputs", [1]),
        ("inputs", {"coolant_temp": "warm"}),
        ("states", 3),
        ("time_ns", "noon"),
        ("slip_energy", "much"),
        ("model", "alsd"),
    ],
)
def test_a_damaged_state_is_told_before_the_kernel_trusts_it(drives, key, value):
    signals, run = drives[0]
    state = {**run.final, "time_ns": None, key: value}
    with pytest.raises(ClutchestError, match=key):
        clutchest.replay(signals, TRUCK, state=state)


def test_a_log_shorter_than_a_row_of_the_grid():
    time = np.array([0.003, 0.013, 0.023])
    names = {
        "engine_speed": "rad/s",
        "engine_torque": "Nm",
        "input_shaft_speed": "rad/s",
        "slave_position": "mm",
    }
    signals = {n: Signal.of(n, unit, time, np.full(3, 45.0)) for n, unit in names.items()}
    table = clutchest.replay(Signals(signals, end=0.023), TRUCK).to_pandas()
    assert len(table) == 1 and np.isfinite(table.engine_speed).all()


def test_a_frame_of_another_day_does_no_harm_to_the_drive(tmp_path):
    """A damaged stamp makes a stretch of its own, in which there is nothing to estimate."""
    frames = read_frames(locate("demo", "logs"))
    frames = frames.take(slice(0, 6000))
    database = load_database(TRUCK)
    frames.t_ns[rows_of(frames, database.message("ClutchActuator"))[700]] -= 10**15
    write_frames(frames, tmp_path / "a.log")
    run = clutchest.replay(clutchest.read_log(tmp_path / "a.log", TRUCK), TRUCK)
    assert len(run.tracks) == 1 == run.summary["drives"]
    assert run.summary["frames"] == 6000
    reason = "in a stretch without what the model needs"
    assert run.summary["frames_rejected"] == {reason: 1}
    (told,) = [words for words in run.summary["warnings"] if "is left out" in words]
    assert "2024-01-06" in told and "no valid sample of engine_speed" in told
    write_run(run, tmp_path / "out")


def test_what_is_missing_is_told_with_the_reader_s_own_words():
    signals = Signals(
        {"coolant_temp": Signal.of("coolant_temp", "°C", np.zeros(1), np.ones(1))},
        warnings=("column 'engine_sped' ignored; did you mean 'engine_speed'?",),
    )
    with pytest.raises(ClutchestError, match="engine_sped"):
        clutchest.replay(signals, TRUCK)


def test_duration_is_the_log_s(drives):
    signals, run = drives[0]
    assert run.summary["duration_s"] == pytest.approx(signals.end, abs=0.02)


@pytest.mark.parametrize("rate", [0.0, -1.0, float("nan"), float("inf")])
def test_a_rate_that_cannot_be(drives, rate):
    with pytest.raises(ClutchestError, match="rate"):
        clutchest.replay(drives[0][0], TRUCK, rate=rate)
