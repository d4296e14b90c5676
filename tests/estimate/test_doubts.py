"""Estimates that are doubtful though nothing contradicts the model: the replay says so."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import clutchest
from clutchest.estimate.against_slip import against_slip
from clutchest.estimate.explanation import remedies
from clutchest.estimate.other_ratio import at_another_ratio
from clutchest.estimate.replay import replay
from clutchest.reading.drafting import guessed_parameters
from clutchest.signals import Signal, Why
from mended_signals import mended


@pytest.fixture(scope="module")
def rig_drive():
    return clutchest.simulate("alsd_rig", "rig-steps", 3, duration=15.0)


def scaled(drive, name, factor):
    return mended(drive, **{name: lambda value: factor * value})


@pytest.mark.parametrize(("log", "vehicle"), [("alsd", "alsd_rig"), ("demo", "truck")])
def test_a_right_model_is_not_doubted(log, vehicle):
    car = clutchest.load_vehicle(vehicle)
    warnings = replay(clutchest.read_log(log, car), car).warnings
    said = ("readings differ", "samples is used", "starts it", "dead sensor")
    assert not any(words in w for w in warnings for words in said)


def test_a_torque_that_is_too_small_to_be_used_is_said(rig_drive):
    """kNm read as Nm: the clutch slips for seconds, but no reading says that it is pressed."""
    run = replay(scaled(rig_drive, "clutch_torque", 1e-3), "alsd_rig")
    assert run.summary["contradiction"] is None
    (warning,) = (w for w in run.warnings if "samples is used" in w)
    assert warning.startswith("clutch_torque: none of its 3000 samples")
    assert "was slipping for" in warning and "a wrong unit" in warning


def test_readings_that_no_single_mistake_explains_are_doubted(rig_drive):
    """A voltage too low by an eighth is not impossible, but no right model predicts so badly."""
    run = replay(scaled(rig_drive, "armature_voltage", 0.875), "alsd_rig")
    assert run.summary["contradiction"] is None
    (warning,) = (w for w in run.warnings if "readings differ" in w)
    assert "motor_angle (" in warning and "discover" in warning


def test_readings_ten_times_their_noise_off_are_not_believed(rig_drive):
    """Half of the voltage: the filter follows the motor all the same."""
    run = replay(scaled(rig_drive, "armature_voltage", 0.5), "alsd_rig")
    assert "10 times its standard deviation" in run.summary["contradiction"]["words"]
    assert not any(state["valid"] for state in run.summary["states"].values())


def test_a_signal_that_is_mostly_beyond_its_range_is_swapped_with_none(rig_drive):
    """A torque in Nmm: what of it is within the range of the bus's field tells of no swap."""
    rig, torque = clutchest.load_vehicle("alsd_rig"), rig_drive["clutch_torque"]
    beyond = Signal.of("clutch_torque", "Nm", torque.time, torque.value * 1e3)
    beyond.why[np.abs(torque.value) > 3.2] = Why.OUT_OF_RANGE
    small = replace(rig_drive, signals={**rig_drive.signals, "clutch_torque": beyond})
    assert not any(r.kind == "swap" and "clutch_torque" in r.words for r in remedies(small, rig))
    assert any("clutch_torque and drive_torque" in r.words for r in remedies(rig_drive, rig))


@pytest.mark.parametrize(
    ("effect", "size", "seed"), [("pack_stiffness", 0.5, 21), ("current_gain", 0.2, 11)]
)
def test_an_error_of_the_model_is_not_taken_for_a_swap(effect, size, seed):
    """Under a pack half as stiff again a drive torque would pass for the clutch's."""
    drive = clutchest.simulate(
        "alsd_rig", "rig-steps", seed, {effect: {"change": size}}, duration=30
    )
    run = replay(drive, "alsd_rig")
    assert run.summary["contradiction"] is None
    assert any("readings differ" in warning for warning in run.warnings)


def launch(**changed):
    """A minute with a launch, some of its signals changed."""
    drive = clutchest.simulate("truck", "launches", 11, duration=60.0)
    new = {
        name: replace(drive[name], value=change(drive[name].value))
        for name, change in changed.items()
    }
    return replace(drive, signals={**drive.signals, **new})


@pytest.fixture(scope="module")
def drafted():
    """The truck as a draft knows it."""
    truck = clutchest.load_vehicle("truck")
    return replace(truck, parameters=guessed_parameters(truck.machine), limits={})


def test_a_position_that_is_turned_round_is_doubted_however_little_is_known(drafted):
    turned = launch(slave_position=lambda x: 64.0 - x)
    run = replay(turned, drafted)
    assert run.summary["contradiction"] is None
    (warning,) = (w for w in run.warnings if w.startswith("zero_position"))
    assert "38.4 ± 1.0 mm (zero_position_ref)" in warning and "sign" in warning


def test_a_torque_with_the_engines_friction_in_it_is_doubted():
    run = replay(launch(engine_torque=lambda torque: torque + 350.0), "truck")
    (warning,) = (w for w in run.warnings if "starts it" in w)
    assert warning.startswith("torque_bias 3") and "0 ± 30 Nm" in warning


def test_a_state_is_doubted_in_the_unit_that_people_read():
    worn = {"free_play_growth": {"growth": 3e-4}}
    run = replay(clutchest.simulate("alsd_rig", "rig-steps", 301, worn, duration=20.0), "alsd_rig")
    (warning,) = (w for w in run.warnings if w.startswith("free_play"))
    assert warning.startswith("free_play 0.5") and "0.190 ± 0.030 mm (free_play)" in warning


def test_wear_within_its_limit_is_not_doubted():
    """2 mm are ten standard deviations of what new clutches differ by, but not beyond 3 mm."""
    worn = clutchest.simulate(
        "truck", "launches", 11, duration=60.0, effects={"wear": {"amount": 2.0}}
    )
    truck = clutchest.load_vehicle("truck")
    assert not any("starts it" in w for w in replay(worn, truck).warnings)
    unlimited = replace(truck, limits={})
    assert any(w.startswith("zero_position") for w in replay(worn, unlimited).warnings)


@pytest.mark.parametrize("teeth", [58.0 / 60.0, 1.1])
def test_a_wrong_number_of_teeth_is_named(drafted, teeth):
    """A clutch that never locks heats up for ever: 5 MJ of a drive that has 0.3."""
    wrong = launch(input_shaft_speed=lambda speed: speed * teeth)
    for vehicle in ("truck", drafted):
        found = replay(wrong, vehicle).summary["contradiction"]
        assert found["signal"] == "input_shaft_speed" and "number of teeth" in found["explanation"]
        assert f"{1.0 / teeth:.4g} times input_shaft_speed" in found["explanation"]


def test_a_shaft_that_never_turns_is_doubted_however_little_is_known(drafted):
    run = replay(launch(input_shaft_speed=np.zeros_like), drafted)
    assert run.summary["contradiction"] is None
    (warning,) = (w for w in run.warnings if "dead sensor" in w)
    assert warning.startswith("input_shaft_speed does not change in 60 s")


@pytest.mark.parametrize("mistake", ["sign", "swap"])
def test_heat_that_would_come_back_is_named_however_little_is_known(drafted, mistake):
    """The parameters of a draft allow for a clutch that drives the engine; the signals do not."""
    wrong = launch(engine_torque=lambda torque: -torque)
    if mistake == "swap":
        drive = launch()
        a, b = drive["engine_speed"], drive["input_shaft_speed"]
        new = {a.name: replace(b, name=a.name), b.name: replace(a, name=b.name)}
        wrong = replace(drive, signals={**drive.signals, **new})
    run = replay(wrong, drafted)
    found = run.summary["contradiction"]
    assert "give back" in found["words"] and "sign of engine_torque" in found["explanation"]
    assert "engine_speed and input_shaft_speed are swapped" in found["explanation"]
    assert not any(state["valid"] for state in run.summary["states"].values())


@pytest.mark.parametrize("effect", ["torque_gain", "torque_bias", "friction_level"])
def test_a_fault_is_no_heat_that_comes_back(effect):
    truck = clutchest.load_vehicle("truck")
    change = {"torque_gain": {"change": 0.3}, "friction_level": {"change": -0.5}}
    effects = {effect: change.get(effect, {"bias": -100.0})}
    drive = clutchest.simulate(truck, "city", 4, duration=120.0, effects=effects)
    assert against_slip(drive, truck) is None


@pytest.mark.parametrize("scenario", ["city", "heating", "slip-steps", "ramps", "pulses"])
def test_no_healthy_drive_has_another_ratio(scenario):
    truck = clutchest.load_vehicle("truck")
    assert at_another_ratio(clutchest.simulate(truck, scenario, 5, duration=120.0), truck) is None


@pytest.mark.parametrize(
    ("name", "factor", "words"),
    [("engine_torque", -1.0, "the sign of engine_torque"), ("input_shaft_speed", 1.05, "teeth")],
)
def test_a_fit_to_signals_that_cannot_be_right_says_so(drafted, name, factor, words):
    """Of a torque of the wrong sign a draft's torque curve was fitted, a third of the true one."""
    wrong = launch(**{name: lambda value: factor * value})
    fit = clutchest.identify("torque-curve", wrong, drafted)
    assert words in fit.warnings[0] and "no number of this fit counts" in fit.warnings[0]
    right = clutchest.identify("torque-curve", launch(), drafted)
    assert not any("counts" in warning for warning in right.warnings)
