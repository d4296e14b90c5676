"""The current sensor's scale is off."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.models.effects.effect import Effect, Gains, Number, Wording


class CurrentGain(Effect):
    """The armature current reads × (1 + ``change``)."""

    name = "current_gain"
    model = "alsd"
    equation = "sensor:armature_current"
    parameters = (Number("change", "1", -0.2, 0.2),)
    wording = {
        "change": Wording(
            "armature current reads {:.3g} % low", "armature current reads {:.3g} % high", 100.0
        )
    }

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {"armature_current_reading": lambda value, q: value * (1 + g.change)}
