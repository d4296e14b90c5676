"""When the differential's clutch is open, slips or sticks: its own state says how it stands."""

from __future__ import annotations

from collections.abc import Container

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
CREEPING = 0.01  # rad/s: at a slower slip nothing says that pressed surfaces slide
WOUND = 0.5  # of the slip: where more than this winds up the structure, surfaces may stick
TORQUE_FLOOR = 5.0  # Nm; a clutch that could carry less counts as open
SLIDES = 0.98  # of the friction potential; surfaces that carry less are held by their bristles


def judge(observed: Observed) -> Regimes:
    """See :class:`~clutchest.models.regimes.RegimeRules`."""
    at, p = observed.at, observed.parameters
    torque = at("clutch_torque")
    torque = at("shaft_torque") if torque is None else torque
    slip, left, right = (at(n) for n in ("slip_speed", "wheel_speed_left", "wheel_speed_right"))
    yielding = 1 / p["torsional_stiffness"]  # rad/Nm
    if slip is None and left is not None and right is not None:  # half-shafts wind up as well
        slip = (left - right) / 2
        yielding += 0.5 / p["halfshaft_stiffness"]
    return pressing(observed.time, torque, slip, yielding, observed.lost, observed.thresholds.guard)


def refine(mode: NDArray[np.uint8], outputs: Outputs, inputs: Container[str]) -> NDArray[np.uint8]:
    """By what the surfaces could carry, and whether they do."""
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
    yielding: float,
    lost: NDArray[np.bool_],
    guard: float,
) -> Regimes:
    """Of a clutch whose equations hold throughout, and whose state says how it stands.

    A torque sensor tells of pressed surfaces only: near the moment at which they touch or
    part, whether they slide already is more than a filter of first order can know.  Nor does
    torque tell the friction before they slide: what still winds up the structure behind
    them, ``yielding`` rad/Nm, is less than they could carry.
    """
    pressed = np.zeros(len(time), bool) if torque is None else np.abs(torque) > TOUCHING
    parted = around(time, ~pressed, guard)
    winding = np.zeros(len(time), bool)
    if torque is not None and slip is not None and len(time) > 1:
        winding = _winding(time, torque * yielding, slip, guard)
    mode = np.where(winding, Mode.locked, Mode.slipping)
    mode = np.where(lost, Mode.unknown, np.where(parted, Mode.open, mode))
    return Regimes(mode.astype(np.uint8), ~lost, ~lost, ~lost)


def _winding(time: Floats, twist: Floats, slip: Floats, over: float) -> NDArray[np.bool_]:
    """Whether the last ``over`` s of slip (rad/s) went into the structure's twist (rad) rather
    than into sliding, or were too little to tell."""
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
)
