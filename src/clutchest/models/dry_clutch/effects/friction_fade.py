"""Friction lost when the disc is hot."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.casadi_later import ca
from clutchest.models.effects.effect import Effect, Gains, Number


class FrictionFade(Effect):
    """Torque × (1 − ``slope`` · max(T_d − ``onset``, 0)/100).

    Source: ME12 § VI, the model deteriorates above about 200 °C.
    """

    name = "friction_fade"
    model = "dry_clutch"
    equation = "torque"
    parameters = (
        Number("slope", "1/(100 K)", 0.0, 0.4),
        Number("onset", "°C", 100.0, 300.0, shape=True, default=200.0, grid=(120.0, 160.0, 200.0)),
    )

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""

        def fade(torque: ca.SX, q: Any) -> ca.SX:
            return torque * (1 - g.slope * ca.fmax(q.temp_disc - g.onset, 0) / 100)

        return {"sliding_torque": fade}
