"""The motor's encoder drifts: it loses counts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.models.effects import Effect, Gains, Number
from clutchest.models.fault import ModelFault
from clutchest.models.symbols import State


class AngleDrift(Effect):
    """Reading = true + ``rate`` · (time since the drive's start).

    The motor comes to rest at home anywhere within its play: only where it presses do angles of
    different engagements compare.
    """

    name = "angle_drift"
    model = "alsd"
    equation = "sensor:motor_angle"
    parameters = (Number("rate", "rad/h", -60.0, 60.0),)
    states = (
        State("hours", "h", "t", "time since the drive's start", 0.0, 0.0, 1.0, carried=False),
    )

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {
            "motor_angle_reading": lambda value, q: value + g.rate * q.hours,
            "hours_rate": lambda rate, q: rate + 1.0 / 3600.0,
        }


FAULT = ModelFault(
    "drift:motor_angle",
    AngleDrift(),
    "rate",
    size=6.0,
    fmi=(20, 21),
    grows_as={"angle_offset": 1.0},
)
