"""Some of the slip power enters the body directly."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.models.effects.effect import Effect, Gains, Number


class HeatSplit(Effect):
    """``fraction`` added to k_P."""

    name = "heat_split"
    model = "dry_clutch"
    equation = "disc_heat"
    parameters = (Number("fraction", "1", -0.5, 0.8),)

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {
            "heat_fraction_body": lambda k_p, q: k_p + g.fraction,
        }
