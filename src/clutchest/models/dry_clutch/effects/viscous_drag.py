"""Drag that is there even in an open clutch."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.models.effects.effect import Effect, Gains, Number


class ViscousDrag(Effect):
    """Drag torque ``coefficient`` · Δω/100."""

    name = "viscous_drag"
    model = "dry_clutch"
    equation = "torque"
    parameters = (Number("coefficient", "Nm s/(100 rad)", 0.0, 60.0),)

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {
            "drag_torque": lambda drag, q: drag + g.coefficient * q.slip_speed / 100,
        }
