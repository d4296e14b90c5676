"""Friction that depends on the oil's temperature."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.models.effects.effect import Effect, Gains, Number


class FrictionOilTemperature(Effect):
    """μ × (1 + ``slope`` · (ϑ_oil − 60)/100).

    Source: ID08 calls for a friction coefficient that depends on temperature.
    """

    name = "friction_oil_temperature"
    model = "alsd"
    equation = "torque"
    parameters = (Number("slope", "1/(100 K)", -1.0, 1.0),)

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {"friction_now": lambda mu, q: mu * (1 + g.slope * (q.oil_temp - 60.0) / 100.0)}
