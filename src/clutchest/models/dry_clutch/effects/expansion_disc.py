"""The disc expands more or less."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.models.effects.effect import Effect, Gains, Number


class ExpansionDisc(Effect):
    """k_exp,2 × (1 + ``change``)."""

    name = "expansion_disc"
    model = "dry_clutch"
    equation = "torque"
    parameters = (Number("change", "1", -0.5, 0.5),)

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {
            "expansion_disc": lambda k, q: k * (1 + g.change),
        }
