"""Which messages carry which signals, and when a healthy signal changes from sample to sample."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from clutchest.reading.wanted import parts
from clutchest.signals import Floats
from clutchest.vehicle import Vehicle

TEMPERATURE = "°C"  # unit of signals that may be constant for minutes
SLOW_S = 30.0  # s; a signal whose gaps may be bridged for longer may be constant for as long


def messages_of(vehicle: Vehicle) -> tuple[str, ...]:
    """Every mapped message once, in the order of the vehicle file."""
    return tuple(dict.fromkeys(bus.message for s in vehicle.signals.values() for bus in parts(s)))


def fluctuating(vehicle: Vehicle) -> tuple[str, ...]:
    """Signals whose healthy samples are never constant: noise changes them all the time."""
    slow = {i.name for i in vehicle.machine.inputs if i.gap >= SLOW_S}
    slow |= {column.name for column in vehicle.machine.columns if column.unit == TEMPERATURE}
    slow |= {name for d in vehicle.machine.demands for name in (*d.demands, d.released)}
    return tuple(name for name in vehicle.signals if name not in slow)


def resting(vehicle: Vehicle) -> frozenset[str]:
    """Signals that may be exactly 0 for as long as the machine is at rest."""
    return frozenset(column.name for column in vehicle.machine.columns if column.rests)


def moving(value: Floats, rests: bool) -> NDArray[np.bool_]:
    """Where samples (n) of a fluctuating signal, which ``rests`` or does not, are not at rest."""
    return value != 0.0 if rests else np.ones(len(value), bool)
