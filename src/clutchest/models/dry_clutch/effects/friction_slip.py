"""Friction that depends on low slip speeds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.casadi_later import ca
from clutchest.models.effects.effect import Effect, Gains, Number


class FrictionSlip(Effect):
    """Torque × (1 + ``change`` · exp(−|Δω|/``speed``)): the Stribeck part of μ.

    Source: ME12 refers to a dependence below about 100 rpm and finds none in its own data.
    """

    name = "friction_slip"
    model = "dry_clutch"
    equation = "torque"
    parameters = (
        Number("change", "1", -0.4, 0.4),
        Number("speed", "rad/s", 2.0, 60.0, shape=True, default=15.0, grid=(5.0, 10.0, 20.0, 40.0)),
    )

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""

        def stribeck(torque: ca.SX, q: Any) -> ca.SX:
            return torque * (1 + g.change * ca.exp(-ca.fabs(q.slip_speed) / g.speed))

        return {"sliding_torque": stribeck}
