"""Friction that rises or falls with slip speed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.casadi_later import ca
from clutchest.models.effects.effect import Effect, Gains, Number, Wording


class FrictionSpeed(Effect):
    """Torque × (1 + ``slope`` · |Δω|/100)."""

    name = "friction_speed"
    model = "dry_clutch"
    equation = "torque"
    parameters = (Number("slope", "s/(100 rad)", -0.3, 0.3),)
    wording = {
        "slope": Wording(
            "friction falls by {:.3g} % per 100 rad/s of slip",
            "friction rises by {:.3g} % per 100 rad/s of slip",
            100.0,
        )
    }

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {
            "sliding_torque": lambda torque, q: (
                torque * (1 + g.slope * ca.fabs(q.slip_speed) / 100)
            ),
        }
