"""Another clutch friction."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.models.effects.effect import Effect, Gains, Number, Wording


class FrictionLevel(Effect):
    """μ × (1 + ``change``)."""

    name = "friction_level"
    model = "alsd"
    equation = "torque"
    parameters = (Number("change", "1", -0.4, 0.4),)
    wording = {
        "change": Wording("friction is {:.3g} % lower", "friction is {:.3g} % higher", 100.0)
    }

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {"friction_now": lambda value, q: value * (1 + g.change)}
