"""Centrifugal forces add to or take from the clamp load."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.models.effects.effect import Effect, Gains, Number


class Centrifugal(Effect):
    """Torque × (1 + ``slope`` · (ω_e/100)²)."""

    name = "centrifugal"
    model = "dry_clutch"
    equation = "torque"
    parameters = (Number("slope", "s^2/(100 rad)^2", -0.1, 0.1),)

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {
            "sliding_torque": lambda torque, q: (
                torque * (1 + g.slope * (q.engine_speed / 100) ** 2)
            ),
        }
