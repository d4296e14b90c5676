"""The body is tied closer or looser to the engine block."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.models.effects.effect import Effect, Gains, Number


class CoolantCoupling(Effect):
    """k_ICE2b × (1 + ``change``)."""

    name = "coolant_coupling"
    model = "dry_clutch"
    equation = "body_heat"
    parameters = (Number("change", "1", -0.8, 2.0, healthy=0.5),)

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {
            "conductance_engine_body": lambda k, q: k * (1 + g.change),
        }
