"""More or less friction in the ball ramp."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.models.effects.effect import Effect, Gains, Number


class BallRampFriction(Effect):
    """μ_b × (1 + ``change``).

    Source: ID08 suspects that its own μ_b is overestimated.
    """

    name = "ball_ramp_friction"
    model = "alsd"
    equation = "axial_force"
    parameters = (Number("change", "1", -0.7, 1.0),)

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {"ball_ramp_friction": lambda value, q: value * (1 + g.change)}
