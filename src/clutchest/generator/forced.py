"""The clutch and its heat under the signals of a drive: no driver and no control unit reacts.

Its text joins that of the truck's other files in one generated module: see ``generator.plant``.
"""

from __future__ import annotations

import numpy as np

from clutchest.generator.physics import (
    capacity,
    expansion,
    rates,
    zero_reference,
)
from clutchest.generator.situation import (
    BODY,
    DISC,
    ENERGY,
    ENGINE,
    HOUSING,
    SHAFT,
    SPEED,
    Record,
)
from clutchest.native import compiled
from clutchest.signals import Floats

# --- the generated module goes on from here ---

NUDGE = 1e-4  # mm, for the slope of the torque over the position


@compiled
def _enter(row: Floats, y: Floats, s: Record, p: Record) -> None:
    """What is known at one row: engine, shaft and truck's speed, piston's place, coolant, ambient;
    whether the clutch is locked; the friction."""
    y[ENGINE], y[SHAFT], y[SPEED] = row[0], row[1], row[2]
    s.plate = min(max(s.plate, row[3] - p.play), row[3] + p.play)
    s.coolant, s.ambient = row[4], row[5]
    s.locked = 1 if row[6] > 0.0 else 0
    s.sign = 1.0 if row[0] > row[1] else -1.0
    s.friction = row[7]


@compiled
def follow(time: Floats, shown: Floats, y: Floats, s: Record, p: Record, out: Floats) -> None:
    """Temperatures and slip energy ``y`` under the signals ``shown`` (n, 8) at ``time`` (n,) s.
    ``out`` (n, 2): the clutch torque in Nm while it is not locked, and where an empty actuator lets
    the piston rest, mm; or (n, 3): the slope of the torque over the position, Nm/mm, as well."""
    heat = (BODY, HOUSING, DISC, ENERGY)
    before, after = np.zeros(len(y)), np.zeros(len(y))
    s.plate = shown[0, 3] + p.play  # it came to rest while closing
    for k in range(len(shown)):
        _enter(shown[k], y, s, p)
        h = time[k] - time[k - 1] if k > 0 else 0.0
        for i in heat:
            y[i] += h * before[i]
        rates(y, s.plate, s, p, after)
        for i in heat:
            y[i] += 0.5 * h * (after[i] - before[i])
            before[i] = after[i]
        out[k] = 0.0
        out[k, 1] = zero_reference(y[ENERGY], s, p) + expansion(y[BODY], y[DISC], p)
        if not s.locked:
            out[k, 0] = -p.engine_inertia * after[ENGINE]  # no torque of the engine drives it here
        if not s.locked and out.shape[1] > 2:
            above = capacity(y, s.plate + NUDGE, s, p)
            below = capacity(y, s.plate - NUDGE, s, p)
            out[k, 2] = s.sign * (above - below) / (2.0 * NUDGE)
