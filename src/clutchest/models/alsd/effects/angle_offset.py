"""The encoder's zero is off."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.models.effects.effect import Effect, Gains, Number, Wording


class AngleOffset(Effect):
    """The motor angle reads ``offset`` too much."""

    name = "angle_offset"
    model = "alsd"
    equation = "sensor:motor_angle"
    parameters = (Number("offset", "rad", -6.0, 6.0),)
    wording = {
        "offset": Wording("motor angle reads {:.3g} rad low", "motor angle reads {:.3g} rad high")
    }

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {"motor_angle_reading": lambda value, q: value + g.offset}
