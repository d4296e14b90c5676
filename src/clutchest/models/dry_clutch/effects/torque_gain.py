"""The engine reports too much or too little torque."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.models.effects.effect import Effect, Gains, Number, Wording


class TorqueGain(Effect):
    """Reported engine torque × (1 + ``change``)."""

    name = "torque_gain"
    model = "dry_clutch"
    equation = "sensor:engine_torque"
    parameters = (Number("change", "1", -0.3, 0.3),)
    wording = {
        "change": Wording(
            "reported engine torque reads {:.3g} % low",
            "reported engine torque reads {:.3g} % high",
            100.0,
        )
    }

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {
            "engine_torque": lambda reading, q: reading / (1 + g.change),
        }
