"""Signals that contradict the model are no error of the model: no fit begins."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import clutchest
from clutchest.errors import ClutchestError
from clutchest.estimate.credible import require_credible
from mended_signals import mended


@pytest.fixture(scope="module")
def rig_drive():
    return clutchest.simulate("alsd_rig", "rig-steps", 3, duration=12.0)


def test_a_current_in_mA_is_refused(rig_drive):
    """It ended in a traceback, and a torque in Nmm in "the model explains these data"."""
    wrong = mended(rig_drive, armature_current=lambda i: 1e3 * i)
    with pytest.raises(ClutchestError, match=r"discover: signals and .* 1000 times too large"):
        clutchest.discover(wrong, "alsd_rig")


def test_the_drive_is_named_where_there_are_several(rig_drive):
    rig = clutchest.load_vehicle("alsd_rig")
    wrong = mended(rig_drive, motor_angle=np.degrees)
    with pytest.raises(ClutchestError, match=r"signals of drive 1 and .* motor_angle is 180/π tim"):
        require_credible(replace(rig_drive, later=(wrong,)), rig, "discover")


def test_signals_that_fit_and_those_that_lack_something_are_not_refused(rig_drive):
    rig = clutchest.load_vehicle("alsd_rig")
    assert require_credible(rig_drive, rig, "discover") == []
    kept = {n: s for n, s in rig_drive.signals.items() if n != "motor_angle"}
    require_credible(replace(rig_drive, signals=kept), rig, "discover")


def test_another_motor_is_said_beside_whatever_is_found():
    """An error of the model may be the reason, too, so that a search begins."""
    rig = clutchest.load_vehicle("alsd_rig")
    other = {"back_emf_constant": 0.08, "torque_constant": 0.08, "armature_resistance": 0.2}
    drive = clutchest.simulate(rig, "rig-steps", 3, duration=40.0)
    (words,) = require_credible(drive, rig.with_parameters(**other), "discover")
    assert words.startswith("signals and model contradict each other: no single sign, swap or unit")


def test_another_bench_is_refused():
    held = clutchest.simulate("alsd_rig", "I3", 3, duration=20.0)
    with pytest.raises(ClutchestError, match=r"motor without its gear.*clutchest identify"):
        clutchest.discover(held, "alsd_rig")
