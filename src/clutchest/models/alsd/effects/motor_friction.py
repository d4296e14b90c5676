"""More or less friction in the actuator's motor."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.models.effects.effect import Effect, Gains, Number


class MotorFriction(Effect):
    """T_C, T_S and σ_2 × (1 + ``change``).

    Source: ID08 blames motor and gear friction for its error in delay at low current.
    """

    name = "motor_friction"
    model = "alsd"
    equation = "motor"
    parameters = (Number("change", "1", -0.7, 2.0),)

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""

        def more(value: Any, q: Any) -> Any:
            return value * (1 + g.change)

        keys = ("motor_coulomb_torque", "motor_static_torque", "motor_viscous")
        return dict.fromkeys(keys, more)
