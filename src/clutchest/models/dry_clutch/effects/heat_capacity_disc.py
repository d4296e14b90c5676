"""The disc heats slower or faster."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.models.effects.effect import Effect, Gains, Number


class HeatCapacityDisc(Effect):
    """(m c_p)_d × (1 + ``change``)."""

    name = "heat_capacity_disc"
    model = "dry_clutch"
    equation = "disc_heat"
    parameters = (Number("change", "1", -0.5, 0.8),)

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {
            "heat_capacity_disc": lambda c, q: c * (1 + g.change),
        }
