"""The slave sensor drifts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.models.effects import Effect, Gains, Number
from clutchest.models.effects.hours import HOURS, hours_rate
from clutchest.models.fault import ModelFault


class PositionDrift(Effect):
    """Reading = true + ``rate`` · (time since the drive's start), as input and as zero position.

    Heat moves the zero position too, but in proportion to the temperatures; wear moves it in
    proportion to slip energy and never upwards.
    """

    name = "position_drift"
    model = "dry_clutch"
    equation = "sensor:slave_position"
    parameters = (Number("rate", "mm/h", -2.0, 2.0),)
    states = (HOURS,)

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {
            "slave_position": lambda reading, q: reading - g.rate * q.hours,
            "zero_position_reading": lambda x0, q: x0 + g.rate * q.hours,
            "hours_rate": hours_rate,
        }


FAULT = ModelFault(
    "drift:slave_position",
    PositionDrift(),
    "rate",
    size=0.4,
    fmi=(20, 21),
    grows_as={"position_offset": 1.0},
)
