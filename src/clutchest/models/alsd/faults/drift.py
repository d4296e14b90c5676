"""The motor's encoder drifts: it loses counts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.models.effects import Effect, Gains, Number
from clutchest.models.effects.hours import HOURS, hours_rate
from clutchest.models.fault import ModelFault


class AngleDrift(Effect):
    """Reading = true + ``rate`` · (time since the drive's start).

    The motor comes to rest at home anywhere within its play: only where it presses do angles of
    different engagements compare.
    """

    name = "angle_drift"
    model = "alsd"
    equation = "sensor:motor_angle"
    parameters = (Number("rate", "rad/h", -60.0, 60.0),)
    states = (HOURS,)

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {
            "motor_angle_reading": lambda value, q: value + g.rate * q.hours,
            "hours_rate": hours_rate,
        }


FAULT = ModelFault(
    "drift:motor_angle",
    AngleDrift(),
    "rate",
    size=6.0,
    fmi=(20, 21),
    grows_as={"angle_offset": 1.0},
)
