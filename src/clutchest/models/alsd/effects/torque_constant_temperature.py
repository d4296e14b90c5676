"""The magnets weaken otherwise with temperature."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.models.effects.effect import Effect, Gains, Number


class TorqueConstantTemperature(Effect):
    """``change`` is added to the temperature coefficient of K_t.

    Source: ID08 (2), K_t(ϑ_a).
    """

    name = "torque_constant_temperature"
    model = "alsd"
    equation = "motor"
    parameters = (Number("change", "1/K", -0.002, 0.002),)

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {"torque_constant_temp_coefficient": lambda value, q: value + g.change}
