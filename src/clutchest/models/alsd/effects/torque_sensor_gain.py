"""The torque sensor's scale is off."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.models.effects.effect import Effect, Gains, Number, Wording


class TorqueSensorGain(Effect):
    """The clutch or shaft torque reads × (1 + ``change``)."""

    name = "torque_sensor_gain"
    model = "alsd"
    equation = "sensor:clutch_torque"
    parameters = (Number("change", "1", -0.2, 0.2),)
    wording = {"change": Wording("torque reads {:.3g} % low", "torque reads {:.3g} % high", 100.0)}

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {
            "clutch_torque_reading": lambda value, q: value * (1 + g.change),
            "shaft_torque_reading": lambda value, q: value * (1 + g.change),
        }
