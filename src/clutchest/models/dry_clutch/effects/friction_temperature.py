"""Friction that rises or falls with disc temperature."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.models.effects.effect import Effect, Gains, Number


class FrictionTemperature(Effect):
    """Torque × (1 + ``slope`` · (T_d − 100)/100)."""

    name = "friction_temperature"
    model = "dry_clutch"
    equation = "torque"
    parameters = (Number("slope", "1/(100 K)", -0.3, 0.3),)

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {
            "sliding_torque": lambda torque, q: torque * (1 + g.slope * (q.temp_disc - 100) / 100),
        }
