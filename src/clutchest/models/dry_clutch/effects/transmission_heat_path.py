"""Heat flows from the body to the gearbox."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.models.effects.effect import Effect, Gains, Number


class TransmissionHeatPath(Effect):
    """The body loses ``conductance`` · (T_b − 80 °C).

    Source: ME12 § V-B neglects this path as a few per cent of the power.
    """

    name = "transmission_heat_path"
    model = "dry_clutch"
    equation = "body_heat"
    parameters = (Number("conductance", "W/K", 0.0, 60.0, healthy=15.0),)

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {
            "body_heat": lambda heat, q: heat - g.conductance * (q.temp_body - 80),
        }
