"""Friction that depends on low slip speeds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.casadi_later import ca
from clutchest.models.effects.effect import Effect, Gains, Number


class FrictionSlip(Effect):
    """μ × (1 + ``change`` · exp(−|ω_s|/``speed``)).

    Source: ID08 calls for a friction coefficient that depends on slip speed.
    """

    name = "friction_slip"
    model = "alsd"
    equation = "torque"
    parameters = (
        Number("change", "1", -0.4, 0.4),
        Number("speed", "rad/s", 0.02, 10.0, shape=True, default=0.5, grid=(0.1, 0.5, 2.0)),
    )

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {
            "friction_now": lambda mu, q: (
                mu * (1 + g.change * ca.exp(-ca.fabs(q.slip_speed) / g.speed))
            )
        }
