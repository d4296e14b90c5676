"""Causes from outside act on the differential where they say, and their absence changes not one
bit."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from clutchest.errors import ClutchestError
from clutchest.generator.alsd.effects import FOREIGN
from clutchest.signals import Signals
from clutchest.simulated import simulate

SECONDS, PRESSED = 3.0, 1.0  # s; from here on the clutch is pressed
# what shows each of them first, and how much of it
SHOWS = {
    "voltage": (0.5, "motor_speed"),
    "load": (0.02, "motor_angle"),
    "home": (0.01, "motor_angle"),
    "damping": (3.0, "motor_angle"),
    "friction": (-0.2, "clutch_torque"),
    "ramp": (1.0, "motor_angle"),
    "film": (30.0, "clutch_torque"),
    "pack_heat": (1e5, "temp_pack"),
    "armature_heat": (1e3, "temp_armature"),
    "play": (1e-5, "free_play"),
    "jam": (1.0, "motor_speed"),
}


@dataclass(frozen=True)
class Acting:
    """What a function of time gives."""

    acts: Callable[[float], Mapping[str, float]]

    def law(self) -> Any:
        return lambda seen: self.acts(seen["time"])

    def readings(self, true: Mapping[str, Any]) -> Mapping[str, Any]:
        return true


def run(acts: Callable[[float], Mapping[str, float]] | None) -> Signals:
    outsider = Acting(acts) if acts else None
    return simulate("alsd_rig", "rig-steps", 1, duration=SECONDS, nominal=True, outsider=outsider)


@pytest.fixture(scope="module")
def plain() -> Signals:
    return run(None)


def test_a_law_that_does_nothing_changes_not_one_bit(plain: Signals):
    idle = run(lambda time: {})
    assert plain.truth and idle.truth
    for name, column in plain.truth.columns.items():
        assert np.array_equal(column, idle.truth.columns[name]), name
    for name, signal in plain.items():
        assert np.array_equal(signal.value, idle[name].value), name


@pytest.mark.parametrize("name", FOREIGN)
def test_each_acts_from_when_it_is_said(plain: Signals, name: str):
    size, column = SHOWS[name]
    acted = run(lambda time: {name: size if time > PRESSED else 0.0})
    assert plain.truth and acted.truth
    before = plain.truth.time <= PRESSED
    change = acted.truth.columns[column] - plain.truth.columns[column]
    assert not change[before].any()
    assert np.abs(change[~before]).max() > 0.01 * np.abs(plain.truth.columns[column]).max()


def test_what_a_differential_does_not_have(plain: Signals):
    with pytest.raises(ClutchestError, match=r"acts on 'frictio'.*did you mean 'friction'"):
        run(lambda time: {"frictio": 0.1})
