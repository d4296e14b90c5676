"""The slave position is late."""

from __future__ import annotations

from clutchest.models.effects.effect import Effect, Number, Wording


class PositionDelay(Effect):
    """The slave position is sent ``delay`` after it was true.

    Source: ME12 § VI blames such delays for the error at the end of torque pulses.
    """

    name = "position_delay"
    model = "dry_clutch"
    equation = "timing:slave_position"
    parameters = (Number("delay", "s", 0.0, 0.3),)
    delays = {"slave_position": "delay"}
    wording = {
        "delay": Wording(
            "position reading is {:.3g} ms early", "position reading is {:.3g} ms late", 1000.0
        )
    }
