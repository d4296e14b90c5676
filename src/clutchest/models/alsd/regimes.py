"""The modes of the differential's clutch, open, slipping and locked, by its estimated state."""

from __future__ import annotations

from collections.abc import Container
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from clutchest.models.regimes import (
    MODE_NAMES,
    Mode,
    Observed,
    Outputs,
    RegimeRules,
    Regimes,
    around,
)
from clutchest.signals import Floats

TOUCHING = 20.0  # Nm, of a measured torque: surfaces are pressed together
CREEPING = 0.01  # rad/s: at a slower slip pressed surfaces may stick
WOUND = 0.5  # of the slip: where more than this winds up the structure, surfaces may stick
TORQUE_FLOOR = 5.0  # Nm; a clutch that could carry less counts as open
STANDING, TURNING = 0.1, 1.0  # rad/s: at a slower speed the motor stands, or creeps
OVER = 0.1  # s, of which the motor's speed is the mean
SLIDES = 0.98  # of the friction potential; surfaces that carry less are held by their bristles


def judge(observed: Observed) -> Regimes:
    """See :class:`~clutchest.models.regimes.RegimeRules`."""
    at, p = observed.at, observed.parameters
    torque = at("clutch_torque")
    torque = at("shaft_torque") if torque is None else torque
    slip, left, right = (at(n) for n in ("slip_speed", "wheel_speed_left", "wheel_speed_right"))
    compliance = 1 / p["torsional_stiffness"]  # rad/Nm
    if slip is None and left is not None and right is not None:  # half-shafts wind up as well
        slip = (left - right) / 2
        compliance += 0.5 / p["halfshaft_stiffness"]
    regimes = pressing(
        observed.time, torque, slip, compliance, observed.lost, observed.thresholds.guard
    )
    angle = at("motor_angle")
    if angle is None:
        return regimes
    speed = _speed(observed.time, angle)
    return replace(regimes, moving=speed > STANDING, fast=speed > TURNING)


def refine(mode: NDArray[np.uint8], outputs: Outputs, inputs: Container[str]) -> NDArray[np.uint8]:
    """Open, slipping or locked, by the torque and what the surfaces could carry."""
    mode, potential = mode.copy(), outputs["friction_potential"]
    carried = np.abs(outputs["transmitted_torque"]) > SLIDES * potential
    known = mode != Mode.unknown
    pressed = np.where(carried, Mode.slipping, Mode.locked)
    mode[known] = np.where(potential < TORQUE_FLOOR, Mode.open, pressed)[known]
    return mode


def pressing(
    time: Floats,
    torque: Floats | None,
    slip: Floats | None,
    compliance: float,
    lost: NDArray[np.bool_],
    guard: float,
) -> Regimes:
    """Regimes of a clutch whose equations hold throughout; the modes say when torque is measured.

    A torque sensor is used while surfaces are pressed and slide.  Near the time at which they touch
    or separate, a filter of first order cannot decide whether they slide already.  Before they
    slide, the torque winds up the structure behind them (``compliance`` rad/Nm) and is less than
    friction could carry.
    """
    pressed = np.zeros(len(time), bool) if torque is None else np.abs(torque) > TOUCHING
    parted = around(time, ~pressed, guard)
    winding = np.zeros(len(time), bool)
    if torque is not None and slip is not None and len(time) > 1:
        winding = _winding(time, torque * compliance, slip, guard)
    mode = np.where(winding, Mode.locked, Mode.slipping)
    mode = np.where(lost, Mode.unknown, np.where(parted, Mode.open, mode))
    engaged = np.ones(len(time), bool) if torque is None else ~parted
    return Regimes(mode.astype(np.uint8), ~lost, ~lost, engaged & ~lost)


def _speed(time: Floats, angle: Floats) -> Floats:
    """The motor's mean speed around each time, rad/s, without its sign, by its measured angle."""
    before, after = (np.interp(time + end, time, angle) for end in (-OVER / 2, OVER / 2))
    return np.abs(after - before) / OVER


def _winding(time: Floats, twist: Floats, slip: Floats, over: float) -> NDArray[np.bool_]:
    """Whether the last ``over`` s of slip (rad/s) went into the structure's twist (rad) rather
    than into sliding, or were too small to decide."""
    path = np.concatenate([[0.0], np.cumsum(np.diff(time) * (slip[1:] + slip[:-1]) / 2)])
    before = time - over
    slipped = path - np.interp(before, time, path)
    wound = twist - np.interp(before, time, twist)
    return (wound * np.sign(slipped) > WOUND * np.abs(slipped)) | (
        np.abs(slipped) < CREEPING * over
    )


RULES = RegimeRules(
    MODE_NAMES,
    ("clutch_torque", "shaft_torque"),
    judge,
    refine,
    "slipping",
    ("guard",),
)
