"""Friction lost when the pack is hot."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.casadi_later import ca
from clutchest.models.effects.effect import Effect, Gains, Number


class FrictionFade(Effect):
    """μ × (1 − ``slope`` · max(ϑ_p − ``onset``, 0)/100).

    Source: ID08 calls for a friction coefficient that depends on temperature.
    """

    name = "friction_fade"
    model = "alsd"
    equation = "torque"
    parameters = (
        Number("slope", "1/(100 K)", 0.0, 0.4),
        Number("onset", "°C", 20.0, 200.0, shape=True, default=60.0, grid=(40.0, 60.0, 100.0)),
    )

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""

        def fade(mu: ca.SX, q: Any) -> ca.SX:
            return mu * (1 - g.slope * ca.fmax(q.temp_pack - g.onset, 0) / 100)

        return {"friction_now": fade}
