"""The harness takes its share of the voltage."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.models.effects.effect import Effect, Gains, Number


class SupplyDrop(Effect):
    """Motor voltage = armature voltage − ``resistance`` · i_a: a corroded contact."""

    name = "supply_drop"
    model = "alsd"
    equation = "current"
    parameters = (Number("resistance", "Ω", 0.0, 0.5),)

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {"motor_voltage": lambda value, q: value - g.resistance * q.current}
