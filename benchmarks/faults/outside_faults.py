"""Faults of the differential that are no change of a number in its equations."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Readings = Mapping[str, Callable[[Floats], Floats]]


@dataclass(frozen=True)
class DriftingAngle:
    """The encoder's zero moves by ``rate`` rad/h from ``onset`` s on."""

    rate: float
    onset: float = 0.0

    def law(self) -> None:
        return None

    def readings(self, true: Readings) -> Readings:
        def drifting(t: Floats) -> Floats:
            return true["motor_angle"](t) + self.rate * np.maximum(t - self.onset, 0.0) / 3600.0

        return {**true, "motor_angle": drifting}


@dataclass(frozen=True)
class JammedMotor:
    """The motor stands from ``onset`` s on, whatever its voltage."""

    onset: float = 0.0

    def law(self) -> Callable[[Mapping[str, float]], Mapping[str, float]]:
        return lambda seen: {"jam": float(seen["time"] >= self.onset)}

    def readings(self, true: Readings) -> Readings:
        return true
