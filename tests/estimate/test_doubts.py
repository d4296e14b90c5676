"""Estimates that are doubtful though nothing contradicts the model: the replay says so."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import clutchest
from clutchest.estimate.explanation import remedies
from clutchest.estimate.replay import replay
from clutchest.signals import Signal, Why


@pytest.fixture(scope="module")
def rig_drive():
    return clutchest.simulate("alsd_rig", "rig-steps", 3, duration=15.0)


def scaled(drive, name, factor):
    signal = drive[name]
    return replace(
        drive, signals={**drive.signals, name: replace(signal, value=factor * signal.value)}
    )


@pytest.mark.parametrize(("log", "vehicle"), [("alsd", "alsd_rig"), ("demo", "truck")])
def test_a_right_model_is_not_doubted(log, vehicle):
    car = clutchest.load_vehicle(vehicle)
    warnings = replay(clutchest.read_log(log, car), car).warnings
    assert not any("readings differ" in w or "samples is used" in w for w in warnings)


def test_a_torque_that_is_too_small_to_be_used_is_said(rig_drive):
    """kNm read as Nm: the clutch slips for seconds, but no reading says that it is pressed."""
    run = replay(scaled(rig_drive, "clutch_torque", 1e-3), "alsd_rig")
    assert run.summary["contradiction"] is None
    (warning,) = (w for w in run.warnings if "samples is used" in w)
    assert warning.startswith("clutch_torque: none of its 3000 samples")
    assert "was slipping for" in warning and "a wrong unit" in warning


def test_readings_that_no_single_mistake_explains_are_doubted(rig_drive):
    """Half of the voltage is not impossible, but no right model predicts so badly."""
    run = replay(scaled(rig_drive, "armature_voltage", 0.5), "alsd_rig")
    assert run.summary["contradiction"] is None
    (warning,) = (w for w in run.warnings if "readings differ" in w)
    assert "clutch_torque (" in warning and "discover" in warning


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
