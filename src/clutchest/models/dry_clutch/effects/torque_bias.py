"""The engine reports torque that is not there."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.models.effects.effect import Effect, Gains, Number, Wording


class TorqueBias(Effect):
    """Reported engine torque + ``bias``."""

    name = "torque_bias"
    model = "dry_clutch"
    equation = "sensor:engine_torque"
    parameters = (Number("bias", "Nm", -300.0, 300.0),)
    wording = {
        "bias": Wording(
            "reported engine torque reads {:.3g} Nm low",
            "reported engine torque reads {:.3g} Nm high",
        )
    }

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {
            "engine_torque": lambda reading, q: reading - g.bias,
        }
