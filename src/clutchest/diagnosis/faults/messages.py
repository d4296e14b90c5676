"""Which messages carry which signals, and when these can tell a stuck one from one at rest."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from clutchest.reading.wanted import parts
from clutchest.signals import Floats
from clutchest.vehicle import Vehicle

AT_REST = (
    "engine_speed",
    "input_shaft_speed",
    "vehicle_speed",
    "motor_position",
    "motor_speed",
    "slip_speed",
    "wheel_speed_left",
    "wheel_speed_right",
    "armature_current",
    "armature_voltage",
)
SLOW = 30.0  # s; what may be bridged for longer may as well stand still


def messages_of(vehicle: Vehicle) -> tuple[str, ...]:
    """Every mapped message once, in the order of the vehicle file."""
    return tuple(dict.fromkeys(bus.message for s in vehicle.signals.values() for bus in parts(s)))


def lively(vehicle: Vehicle) -> tuple[str, ...]:
    """Signals that never stand still while they are true: noise moves them from sample to sample.

    A temperature may well stand still.
    """
    inputs = {i.name: i.gap for i in vehicle.machine.inputs}
    return tuple(
        name
        for name in vehicle.signals
        if not name.endswith("_temp") and inputs.get(name, 0.0) < SLOW
    )


def moving(name: str, value: Floats) -> NDArray[np.bool_]:
    """Where a sample (n) of a lively signal is not at rest: a speed of nought stays so."""
    return value != 0.0 if name in AT_REST else np.ones(len(value), bool)
