"""The armature's resistance grows otherwise with temperature."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.models.effects.effect import Effect, Gains, Number


class ResistanceTemperature(Effect):
    """``change`` is added to the temperature coefficient of R_a.

    Source: ID08 (1), R_a(ϑ_a), identified over a wide range of ϑ_a.
    """

    name = "resistance_temperature"
    model = "alsd"
    equation = "current"
    parameters = (Number("change", "1/K", -0.002, 0.002),)

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {"resistance_temp_coefficient": lambda value, q: value + g.change}
