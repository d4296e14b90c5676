"""What a drive with the truck consists of: steps, states, phases, records.

Its text joins that of the truck's other files in one generated module: see ``generator.plant``.
"""

from __future__ import annotations

from math import inf
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from clutchest.signals import Floats

# --- the generated module goes on from here ---

STEP = 1e-3  # s: the control unit decides and the integrator steps once per STEP
FAST = 2  # steps between records of the fast quantities
MODES = ("open", "slipping", "locked", "retracted")

Record = Any  # a row of a structured array, its columns as attributes

# The integrated state.
BODY, HOUSING, DISC, ENGINE, SHAFT, SPEED, ENERGY, TORQUE = range(8)
# What a truck of more parts integrates beside it (see ``parts``).
FACES, FLYWHEEL, REAR, DELIVERED, STRETCH = range(8, 13)
STATES, STATES_IN_PARTS = 8, 13
# What the control unit is busy with.
RESTING, OPENING, NEUTRAL, LAUNCHING, CLOSING, DRIVING, UNLOADING, HOLDING = range(8)

# What acts on the truck from outside these equations (see ``outsider``), 0 unless something does:
# share of the friction torque and torque (Nm) added to it, load on the engine (Nm) that no report
# contains, heat into the three masses (W), shift of the zero position and with it the curve (mm).
FOREIGN = (
    "torque_share",
    "torque",
    "engine_load",
    "body_heat",
    "housing_heat",
    "disc_heat",
    "zero_position",
)

# All that changes during a drive beside the integrated state.
SITUATION = np.dtype(
    [(name, np.int64) for name in ("phase", "leg", "gear", "next_gear", "bench", "held", "locked")]
    + [
        (name, np.float64)
        for name in (
            "since",
            "lock_time",
            "setpoint",
            "target",
            "trim",
            "sensed",
            "engine_before",
            "request",
            "brake",
            "command",
            "ratio",
            "sync_rate",
            "sync_speed",
            "sign",
            "carried",
            "motor",
            "port",
            "slave",
            "plate_before",
            "plate",
            "friction",
            "coolant",
            "ambient",
            "grade",
            *(f"foreign_{name}" for name in FOREIGN),
        )
    ]
)

IDLE = 62.8  # rad/s
OPENED, RETRACT = 11.5, -inf  # mm
SHAFT_INERTIA, SHAFT_DRAG = 0.4, 0.03  # kg m², Nm s: input shaft alone, in neutral
ENGINE_LAG, SERVO_LAG, SERVO_RATE, PORT = 0.08, 0.025, 45.0, 0.5  # s, s, mm/s, mm
STANDING = 40e3  # N: brake of a standing truck
AIR = 3.3  # kg/m: half of density · drag coefficient · frontal area


class TruckDrive(NamedTuple):
    """A drive in progress: timetable ``legs``, ``slow`` (n, 3) friction, coolant and ambient every
    GRID s, the truck's ``numbers`` (1,) and ``situation`` (1,), records, and the integrated
    ``state`` (8), of a truck of more parts (13)."""

    legs: NDArray
    slow: Floats
    numbers: NDArray
    situation: NDArray
    state: Floats


class TruckRecord(NamedTuple):
    """What is written: rows of ``fast`` (n, 6), every FAST STEPs: engine speed, shaft speed, slave,
    motor, engine torque, truck's speed; and of ``truth`` (n, 8), every ``truth_every`` STEPs: body,
    housing, disc, x0_ref, friction, clutch torque, slip energy, mode (index into MODES)."""

    truth_every: int
    fast: Floats
    truth: Floats
