"""Driving wind cools the housing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.models.effects.effect import Effect, Gains, Number


class HousingAirflow(Effect):
    """k_h2amb × (1 + ``slope`` · v/20)."""

    name = "housing_airflow"
    model = "dry_clutch"
    equation = "housing_heat"
    parameters = (Number("slope", "s/(20 m)", -0.5, 3.0, healthy=0.75),)

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {
            "conductance_housing_ambient": lambda k, q: k * (1 + g.slope * q.vehicle_speed / 20),
        }
