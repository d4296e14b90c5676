"""The body expands more or less."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.models.effects.effect import Effect, Gains, Number


class ExpansionBody(Effect):
    """k_exp,1 × (1 + ``change``)."""

    name = "expansion_body"
    model = "dry_clutch"
    equation = "zero_position"
    parameters = (Number("change", "1", -0.5, 0.5),)

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {
            "expansion_body": lambda k, q: k * (1 + g.change),
        }
