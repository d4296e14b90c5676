"""Estimates that are doubtful though nothing contradicts the model: the replay says so."""

from __future__ import annotations

from dataclasses import replace

import pytest

import clutchest
from clutchest.estimate.replay import replay


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
