"""Signals and model that cannot both be right: no state is valid, and the reason is said."""

from __future__ import annotations

from dataclasses import replace
from io import StringIO
from itertools import pairwise

import numpy as np
import pytest
from rich.console import Console

import clutchest
from clutchest import units
from clutchest.errors import ClutchestError
from clutchest.estimate.consistency import Consistency
from clutchest.estimate.explanation import OF_UNIT, remedies
from clutchest.estimate.other_bench import on_other_bench
from clutchest.estimate.replay import replay
from clutchest.estimate.run import Estimate, Innovations
from clutchest.generator.alsd.generate import draw
from clutchest.record.report import markdown
from clutchest.record.terminal import print_run
from clutchest.signals import Signal
from mended_signals import mended

GOOD = 0.7  # |z| of the innovations of a right model


@pytest.fixture(scope="module")
def demo():
    return clutchest.read_log("demo", "truck")


@pytest.fixture(scope="module")
def healthy(demo):
    return replay(demo, "truck")


def printed(run):
    console = Console(file=StringIO(), width=200)
    print_run(run, console)
    return console.file.getvalue()


def judge(model):
    return Consistency(model, 1.0)


def track(healthy, seconds, z=GOOD, sensor=0, **states):
    """A track of ``seconds`` s whose innovations are ``z`` standard deviations, with states that
    have other values."""
    rows = np.arange(0.0, seconds, 0.1)
    whole = healthy.tracks[0]
    ones = np.ones(len(rows))
    values = {n: float(np.nanmedian(e.value)) for n, e in whole.states.items()} | states
    signs = np.where(np.arange(len(rows)) % 2, 1.0, -1.0)
    return replace(
        whole,
        time=rows,
        mode=np.ones(len(rows), np.uint8),
        states={n: Estimate(v * ones, 0.01 * ones, ones > 0) for n, v in values.items()},
        clutch_torque=Estimate(ones, ones, ones > 0),
        slip_energy=Estimate(1e5 * rows, ones, ones > 0),
        innovations=Innovations(
            whole.innovations.names, rows, np.full(len(rows), sensor, np.int8), z * signs, ones
        ),
    )


def portion(track, start, stop):
    a, b = np.searchsorted(track.time, [start, stop])
    cut = slice(int(a), int(b))

    def of(each):
        return replace(each, value=each.value[cut], std=each.std[cut], valid=each.valid[cut])

    events = track.innovations
    return replace(
        track,
        time=track.time[cut],
        mode=track.mode[cut],
        states={n: of(e) for n, e in track.states.items()},
        clutch_torque=of(track.clutch_torque),
        slip_energy=of(track.slip_energy),
        innovations=replace(
            events,
            time=events.time[cut],
            sensor=events.sensor[cut],
            innovation=events.innovation[cut],
            std=events.std[cut],
        ),
    )


@pytest.fixture(scope="module")
def truck(healthy):
    return healthy.vehicle.machine.equations(healthy.signals.available)


def test_a_healthy_drive_contradicts_nothing(healthy):
    assert healthy.summary["contradiction"] is None and "contradiction" not in healthy.final
    assert healthy.summary["states"]["friction"]["valid"]


def test_innovations_far_outside_the_noise_are_found_and_a_transient_is_not(truck, healthy):
    steady = judge(truck)
    steady.take(track(healthy, 300.0))
    assert steady.found is None
    wrong = judge(truck)
    wrong.take(track(healthy, 300.0, z=8.0))
    assert wrong.found is not None and 30.0 <= wrong.found.since_s <= 90.0
    assert "engine_speed differs" in wrong.found.words
    transient = track(healthy, 300.0)
    events = transient.innovations
    large = np.where((events.time > 100.0) & (events.time < 120.0), 50.0, 1.0)
    once = judge(truck)
    once.take(replace(transient, innovations=replace(events, innovation=large * events.innovation)))
    assert once.found is None


def test_innovations_beyond_what_any_effect_makes_are_found_within_a_short_log(truck, healthy):
    """Of 30 s there are two whole stretches."""
    tolerance = truck.sensors[0].tolerance
    for times, found in ((2.5, False), (3.5, True)):
        short = judge(truck)
        short.take(track(healthy, 29.5, z=0.6745 * times * tolerance))
        assert (short.found is not None) == found


@pytest.mark.parametrize(
    ("state", "value"), [("friction", -0.9), ("temp_body", -631.0), ("temp_disc", 2000.0)]
)
def test_what_is_physically_impossible_is_found_once_it_lasts(truck, healthy, state, value):
    impossible = track(healthy, 60.0, **{state: value})
    short, lasting = judge(truck), judge(truck)
    short.take(portion(impossible, 0.0, 8.0))
    assert short.found is None
    after = lasting.take(impossible)
    assert lasting.found is not None and state in lasting.found.words
    assert 9.0 <= lasting.found.since_s <= 11.0
    for each in (*after.states.values(), *after.outputs.values()):
        assert not each.valid[after.time >= lasting.found.since_s].any()


def test_heat_does_not_come_back(truck, healthy):
    drive = track(healthy, 60.0)
    energy = replace(
        drive.slip_energy, value=np.minimum(drive.slip_energy.value, 5e6 - 1e5 * drive.time)
    )
    backwards = judge(truck)
    backwards.take(replace(drive, slip_energy=energy))
    assert backwards.found is not None and "heat does not come back" in backwards.found.words


def test_pieces_are_judged_as_the_whole(truck, healthy):
    drive = track(healthy, 200.0, z=8.0, friction=-0.5)
    whole, pieces = judge(truck), judge(truck)
    after = whole.take(drive)
    edges = np.concatenate([[0.0], np.sort(np.random.default_rng(1).uniform(0, 200, 300)), [201.0]])
    parts = [pieces.take(portion(drive, a, b)) for a, b in pairwise(edges)]
    assert pieces.found == whole.found
    valid = np.concatenate([part.states["temp_body"].valid for part in parts])
    np.testing.assert_array_equal(valid, after.states["temp_body"].valid)


def test_a_wrong_sign_makes_every_state_invalid_everywhere(demo, healthy):
    run = replay(mended(demo, engine_torque=lambda m: -m), "truck")
    found = run.summary["contradiction"]
    assert found["signal"] == "engine_torque"
    assert "the sign of engine_torque is wrong" in found["explanation"]
    assert all(
        not state["valid"] and "contradict" in state["why"] and state["needs"] is None
        for name, state in run.summary["states"].items()
        if state["value"] is not None
    )
    assert not run.to_pandas().filter(like="_valid").to_numpy().any()
    assert markdown(run).splitlines()[4].startswith("**signals and model contradict each other")
    again = replay(demo, "truck", state={**run.final, "time_ns": None})
    assert any("nothing of it is carried over" in w for w in again.summary["warnings"])
    np.testing.assert_array_equal(
        again.tracks[0].states["friction"].value, healthy.tracks[0].states["friction"].value
    )


@pytest.mark.slow
def test_no_life_and_no_heat_follow_from_signals_that_contradict_the_model(demo, healthy):
    assert "of heat" in printed(healthy) and "Remaining life" in printed(healthy)
    assert healthy.summary["wear"] and healthy.summary["slip_energy_J"] > 0.0
    run = replay(mended(demo, slave_position=lambda x: np.full_like(x, x[0])), "truck")
    assert run.summary["contradiction"] and run.summary["engagements"]
    assert run.summary["wear"] is run.summary["slip_energy_J"] is None
    assert "of heat" not in printed(run) and "life" not in printed(run)


def test_a_state_file_with_an_impossible_value_is_damaged(demo, healthy):
    left = healthy.final
    place = left["states"].index("friction")
    x = [-0.9 if k == place else value for k, value in enumerate(left["x"])]
    with pytest.raises(ClutchestError, match=r"damaged: 'x' must be physically possible: friction"):
        replay(demo, "truck", state={**left, "x": x, "time_ns": None})


WRONG = {
    "swapped speeds": ("swap", "engine_speed and input_shaft_speed are swapped"),
    "torque in kNm": ("unit", "engine_torque is 1000 times too small"),
    "speed in rpm": ("unit", "engine_speed is 60/(2π) times too large"),
    "dead sensor": ("dead", "slave_position does not change at all"),
}


@pytest.mark.slow
@pytest.mark.parametrize("what", WRONG)
def test_the_explanation_is_named(demo, what):
    kind, words = WRONG[what]
    if kind == "swap":
        a, b = demo["engine_speed"], demo["input_shaft_speed"]
        new = {a.name: replace(b, name=a.name), b.name: replace(a, name=b.name)}
        signals = replace(demo, signals={**demo.signals, **new})
    else:
        change = {
            "torque in kNm": {"engine_torque": lambda m: m / 1000.0},
            "speed in rpm": {"engine_speed": lambda w: w * 60.0 / (2.0 * np.pi)},
            "dead sensor": {"slave_position": lambda x: np.full_like(x, np.median(x))},
        }[what]
        signals = mended(demo, **change)
    run = replay(signals, "truck")
    assert words in run.summary["contradiction"]["explanation"]
    assert not any(state["valid"] for state in run.summary["states"].values())


@pytest.mark.slow
def test_diagnose_names_the_signal_before_the_clutch(demo):
    run = replay(mended(demo, engine_torque=lambda m: -m), "truck")
    fault = clutchest.diagnose(run).faults[0]
    assert fault.fault == "contradiction:engine_torque" and "sign" in fault.what


@pytest.mark.slow
def test_signs_that_cannot_be_told_apart_are_both_named():
    """Torque against slip, or slip against torque."""
    rig = clutchest.load_vehicle("alsd_rig")
    drive = clutchest.simulate(rig, "rig-steps", 1, duration=30.0)
    run = replay(mended(drive, clutch_torque=lambda m: -m), rig)
    words = run.summary["contradiction"]["explanation"]
    assert "the sign of slip_speed is wrong" in words
    assert "the sign of clutch_torque is wrong" in words
    (fault, *_) = clutchest.diagnose(run).faults
    assert {"contradiction:slip_speed", "contradiction:clutch_torque"} == set(fault.set)


@pytest.fixture(scope="module")
def rig_drive():
    return clutchest.simulate(clutchest.load_vehicle("alsd_rig"), "rig-steps", 1, duration=15.0)


@pytest.mark.parametrize("mistake", ["sign", "swap"])
def test_a_sign_and_a_swap_that_fit_as_well_are_both_named(mistake):
    """Swapped speeds make other readings those of the engine, so likelihoods do not decide."""
    drive = clutchest.simulate("truck", "launches", 11, truck_seed=1, duration=180.0)
    if mistake == "sign":
        wrong = mended(drive, engine_torque=lambda torque: -torque)
    else:
        a, b = drive["engine_speed"], drive["input_shaft_speed"]
        new = {a.name: replace(b, name=a.name), b.name: replace(a, name=b.name)}
        wrong = replace(drive, signals={**drive.signals, **new})
    explanation = replay(wrong, "truck").summary["contradiction"]["explanation"]
    assert "the sign of engine_torque is wrong" in explanation
    assert "engine_speed and input_shaft_speed are swapped" in explanation


def test_a_rig_whose_signals_are_all_zero_is_not_believed(rig_drive):
    run = replay(mended(rig_drive, **dict.fromkeys(rig_drive.signals, np.zeros_like)), "alsd_rig")
    assert "all signals are zero" in run.summary["contradiction"]["words"]
    assert not run.to_pandas().filter(like="_valid").any(axis=None)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["armature_current", "armature_voltage", "armature_temp"])
def test_a_dead_sensor_of_the_rig_is_named(name):
    rig_drive = clutchest.simulate("alsd_rig", "rig-steps", 3, duration=30.0)
    run = replay(mended(rig_drive, **{name: np.zeros_like}), "alsd_rig")
    found = run.summary["contradiction"]
    assert f"{name} does not change at all" in found["explanation"]
    assert not run.to_pandas().filter(like="_valid").any(axis=None)


@pytest.mark.slow
def test_signals_of_different_units_that_are_swapped_are_named(rig_drive):
    """Columns of a table, in the wrong order."""
    current, angle = rig_drive["armature_current"], rig_drive["motor_angle"]
    swapped = mended(
        rig_drive, armature_current=lambda _: angle.value, motor_angle=lambda _: current.value
    )
    found = replay(swapped, "alsd_rig").summary["contradiction"]
    assert "armature_current and motor_angle are swapped" in found["explanation"]


@pytest.mark.slow
def test_an_angle_in_degrees_is_named(rig_drive):
    found = replay(mended(rig_drive, motor_angle=np.degrees), "alsd_rig").summary["contradiction"]
    assert "motor_angle is 180/π times too large" in found["explanation"]


@pytest.mark.slow
def test_an_angle_in_revolutions_is_named(rig_drive):
    turns = mended(rig_drive, motor_angle=lambda a: a / (2.0 * np.pi))
    found = replay(turns, "alsd_rig").summary["contradiction"]
    assert "motor_angle is 2π times too small" in found["explanation"]


def test_a_cure_is_judged_with_the_spreads_of_the_parameters():
    """As the replay is that it explains.  Of another specimen whose angle is sampled less often
    than its current, no cure fits within the noise alone."""
    rig = clutchest.load_vehicle("alsd_rig")
    drive = clutchest.simulate(rig, "rig-steps", 3, duration=30.0)
    angle, current = drive["motor_angle"], drive["armature_current"]
    time = np.arange(current.time[0], current.time[-1], 1e-3)
    fast = Signal.of("armature_current", "A", time, np.interp(time, current.time, current.value))
    slow = angle.take(np.arange(0, len(angle), 2))
    sampled = replace(
        drive, signals={**drive.signals, "armature_current": fast, "motor_angle": slow}
    )
    assert replay(sampled, rig).summary["contradiction"] is None
    found = replay(mended(sampled, motor_angle=np.negative), rig).summary["contradiction"]
    assert "the sign of motor_angle is wrong" in found["explanation"]


def test_the_stretch_with_which_a_short_drive_ends_is_judged_too(truck, healthy):
    """A log of 20 s has but one that is whole (development)."""
    wrong = track(healthy, 19.9, z=30.0 * truck.sensors[0].tolerance)
    begun, over = judge(truck), judge(truck)
    begun.take(wrong)
    over.take(wrong, last=True)
    assert begun.found is None and over.found is not None


def test_a_swap_that_makes_no_machine_is_not_tried(demo):
    """A torque of 20 Nm in an outside air of 2000 °C."""
    truck = clutchest.load_vehicle("truck")
    tried = {r.words for r in remedies(demo, truck) if r.kind == "swap"}
    assert "engine_speed and input_shaft_speed are swapped" in tried
    assert not any("engine_torque" in words and "temp" in words for words in tried)


def test_a_temperature_has_no_sign_and_no_factor(demo):
    truck = clutchest.load_vehicle("truck")
    tried = [r for r in remedies(demo, truck) if r.kind != "swap"]
    assert {r.signal for r in tried} >= {"engine_speed", "engine_torque", "slave_position"}
    assert not {r.signal for r in tried} & {"coolant_temp", "ambient_temp"}


@pytest.mark.parametrize(
    ("unit", "others"),
    [
        ("rad", {"deg", "rev"}),
        ("rad/s", {"rpm", "deg/s", "rev/s"}),
        ("m/s", {"km/h"}),
        ("bar", {"Pa", "MPa"}),
        ("MPa", {"Pa", "bar"}),
        ("Pa", {"MPa", "bar"}),
    ],
)
def test_factors_are_those_of_other_units(unit, others):
    """Beside 1000 and 100, which are those of kilopascals, millimetres and the like."""
    apart = {max(units.convert(1.0, unit, to), units.convert(1.0, to, unit)) for to in others}
    assert sorted(OF_UNIT[unit]) == pytest.approx(sorted(apart))
    assert set(OF_UNIT) == {"rad", "rad/s", "m/s", "bar", "MPa", "Pa"}


BENCHES = {
    "I1": "rotor-held",
    "I2": "rotor-held",
    "I3": "motor-alone",
    "I4": "rotor-held",
    "I5": "motor-alone",
    "I6": "no-pack",
    "I7": "output-fixed",
}


@pytest.mark.parametrize("scenario", BENCHES)
def test_the_bench_of_a_log_is_recognised(scenario):
    lasts = None if scenario in ("I2", "I5", "I6", "I7") else 40.0
    vehicle = clutchest.load_vehicle("alsd_rig")
    found = on_other_bench(clutchest.simulate(vehicle, scenario, 1, duration=lasts), vehicle)
    assert found is not None and found.kind == "bench"
    assert BENCHES[scenario] in found.words


@pytest.mark.parametrize(
    ("vehicle", "scenario"),
    [("alsd_rig", s) for s in ("rig-steps", "rig-slow", "rig-ramps", "I8")] + [("alsd_car", "car")],
)
@pytest.mark.parametrize("growth", [0.0, 3e-4])
def test_the_whole_machine_is_no_other_bench(vehicle, scenario, growth):
    """Nor is one whose pack is worn to its limit."""
    effects = {"free_play_growth": {"growth": growth}} if growth else {}
    drive = clutchest.simulate(vehicle, scenario, 2, effects, duration=15.0)
    assert on_other_bench(drive, clutchest.load_vehicle(vehicle)) is None


def test_a_log_of_another_bench_is_not_believed():
    """A rotor that is held: the equations explain it by a motor that turns back and forth."""
    drive = clutchest.simulate("alsd_rig", "I4", 1, duration=30.0)
    run = replay(drive, "alsd_rig")
    assert "rotor-held" in run.summary["contradiction"]["words"]
    assert not any(state["valid"] for state in run.summary["states"].values())
    assert run.final["contradiction"]
    assert run.tracks[0].responses == () and run.summary["tracking"] == []


SPECIMEN = ("value", "spread")
OTHER = {"wrong motor": ("back_emf_constant", 2.0), "wrong gear": ("gear_ratio", 1.6)}


@pytest.mark.parametrize("key, factor", OTHER.values(), ids=OTHER)
def test_the_log_of_another_machine_is_not_believed(key, factor):
    """The filter follows the readings of a differential with another motor or gear, each ten times
    its standard deviation off, to a free play that is none of it."""
    rig = clutchest.load_vehicle("alsd_rig")
    other = rig.with_parameters(**{key: factor * rig.parameters[key].value})
    run = replay(clutchest.simulate(rig, "rig-steps", 7, duration=40.0), other)
    (track,) = run.tracks
    assert track.contradiction.kind == "misfit" and not track.contradiction.is_explained
    assert "10 times its standard deviation, root mean square" in track.contradiction.words
    assert not any(state["valid"] for state in run.summary["states"].values())
    assert run.final["contradiction"] and run.summary["wear"] is None


@pytest.mark.parametrize(("growth", "seed"), [(0.0, 21), (2.9e-4, 21), (3e-4, 301)])
def test_a_pack_worn_beyond_its_limit_is_believed(growth, seed):
    """From a start ten standard deviations off."""
    effects = {"free_play_growth": {"growth": growth}}
    drive = clutchest.simulate("alsd_rig", "rig-steps", seed, effects, duration=40.0)
    run = replay(drive, "alsd_rig")
    assert run.summary["contradiction"] is None
    rig = clutchest.load_vehicle("alsd_rig").parameters
    nominal, spread = ({key: getattr(p, what) for key, p in rig.items()} for what in SPECIMEN)
    truth = draw(nominal, spread, seed)
    friction = truth["friction_coefficient"] / nominal["friction_coefficient"]
    for name, true in (("free_play", truth["free_play"] + growth), ("friction", friction)):
        state = run.summary["states"][name]
        assert state["valid"] and abs(state["value"] - true) < 3.0 * state["std"], name


def test_a_pack_that_was_identified_when_new_may_wear():
    """By a hundred standard deviations of what is known of the new one, without a stated limit."""
    rig = clutchest.load_vehicle("alsd_rig")
    nominal, spread = (
        {k: getattr(p, what) for k, p in rig.parameters.items()} for what in SPECIMEN
    )
    new = draw(nominal, spread, 61)["free_play"]
    known = replace(rig.parameters["free_play"], value=new, spread=3e-7)
    car = replace(rig, parameters={**rig.parameters, "free_play": known}, limits={})
    effects = {"free_play_growth": {"growth": 3e-5}}
    run = replay(clutchest.simulate(rig, "rig-steps", 61, effects, duration=30.0), car)
    state = run.summary["states"]["free_play"]
    assert state["valid"] and abs(state["value"] - new - 3e-5) < 3.0 * state["std"]


@pytest.mark.slow
def test_a_worn_pack_has_no_other_fault():
    effects = {"free_play_growth": {"growth": 3e-4}}
    run = replay(clutchest.simulate("alsd_rig", "rig-steps", 301, effects), "alsd_rig")
    assert [fault.fault for fault in clutchest.diagnose(run).faults] == ["wear"]


@pytest.mark.slow
@pytest.mark.parametrize(
    "effect",
    [
        {"friction_level": {"change": -0.5}},
        {"wear": {"amount": 1.5, "rate": 0.1}},
        {"torque_gain": {"change": 0.3}},
        {"position_delay": {"delay": 0.2}},
        {"heat_split": {"fraction": 0.6}},
    ],
)
def test_a_large_effect_is_no_contradiction(effect):
    run = replay(clutchest.simulate("truck", "launches", 3, effect, duration=240.0), "truck")
    assert run.summary["contradiction"] is None
