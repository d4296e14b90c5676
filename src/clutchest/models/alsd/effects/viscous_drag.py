"""Oil drags between the plates."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.casadi_later import ca
from clutchest.models.effects.effect import Effect, Gains, Number


class ViscousDrag(Effect):
    """Drag torque of ``coefficient`` per 10 rad/s of slip, also when open.

    Source: ID08 leaves the fluid film's own torque out.
    """

    name = "viscous_drag"
    model = "alsd"
    equation = "torque"
    parameters = (Number("coefficient", "Nm s/(10 rad)", 0.0, 200.0),)

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {"drag_level": lambda level, q: level + g.coefficient * ca.fabs(q.slip_speed) / 10.0}
