"""The slave sensor drifts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.diagnosis.faults.fault import ModelFault
from clutchest.models.effects import Effect, Gains, Number
from clutchest.models.symbols import State


class PositionDrift(Effect):
    """Reading = true + ``rate`` · (time since the drive began), as input and as zero position.

    Heat moves the zero position too, but as the temperatures do, and wear moves it with slip
    energy and never upwards.
    """

    name = "position_drift"
    model = "dry_clutch"
    equation = "sensor:slave_position"
    parameters = (Number("rate", "mm/h", -2.0, 2.0),)
    states = (State("hours", "h", "t", "time since the drive began", 0.0, 0.0, 1.0, carried=False),)

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {
            "slave_position": lambda reading, q: reading - g.rate * q.hours,
            "zero_position_reading": lambda x0, q: x0 + g.rate * q.hours,
            "hours_rate": lambda rate, q: rate + 1.0 / 3600.0,
        }


class Drift(ModelFault):
    """The slave sensor drifts, from the drive's begin or from an hour of its own."""

    name, effect = "drift:slave_position", "position_drift"
    model = "dry_clutch"
    key, size = "rate", 0.4
    fmi = (20, 21)

    def make(self) -> Effect:
        """See :meth:`ModelFault.make`."""
        return PositionDrift()

    def onset(self, hours: float) -> Mapping[str, float]:
        """See :meth:`ModelFault.onset`: by then it would have drifted so far."""
        return {"position_offset": hours}
