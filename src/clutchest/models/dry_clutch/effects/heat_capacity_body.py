"""The body heats slower or faster."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.models.effects.effect import Effect, Gains, Number


class HeatCapacityBody(Effect):
    """(m c_p)_b × (1 + ``change``)."""

    name = "heat_capacity_body"
    model = "dry_clutch"
    equation = "body_heat"
    parameters = (Number("change", "1", -0.5, 0.8),)

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {
            "heat_capacity_body": lambda c, q: c * (1 + g.change),
        }
