"""Friction higher or lower than nominal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.models.effects.effect import Effect, Gains, Number, Wording


class FrictionLevel(Effect):
    """Torque × (1 + ``change``): glazing, oil, another lining."""

    name = "friction_level"
    model = "dry_clutch"
    equation = "torque"
    parameters = (Number("change", "1", -0.5, 0.5),)
    wording = {
        "change": Wording("friction is {:.3g} % lower", "friction is {:.3g} % higher", 100.0)
    }

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {
            "sliding_torque": lambda torque, q: torque * (1 + g.change),
        }
