"""The reported engine torque is late."""

from __future__ import annotations

from clutchest.models.effects.effect import Effect, Number, Wording


class TorqueDelay(Effect):
    """The reported engine torque is sent ``delay`` after it was true.

    Source: ME12 § VI blames such delays for the error at the end of torque pulses.
    """

    name = "torque_delay"
    model = "dry_clutch"
    equation = "timing:engine_torque"
    parameters = (Number("delay", "s", 0.0, 0.3),)
    delays = {"engine_torque": "delay"}
    wording = {
        "delay": Wording(
            "reported engine torque is {:.3g} ms early",
            "reported engine torque is {:.3g} ms late",
            1000.0,
        )
    }
