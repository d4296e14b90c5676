"""Play in the release mechanism."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.casadi_later import ca
from clutchest.models.effects.effect import Effect, Gains, Number
from clutchest.models.symbols import State


class PositionHysteresis(Effect):
    """The release mechanism has play of half-width ``play``: a play operator behind the sensor.

    The state d = y − x, of the plate's position y, is held while x moves inside the play and is
    dragged along at its ends: d ← d − Δx, clipped to ±play after each step.
    """

    name = "position_hysteresis"
    model = "dry_clutch"
    equation = "sensor:slave_position"
    parameters = (Number("play", "mm", 0.0, 0.5, trials=(0.05, 0.2)),)
    states = (State("position_play", "mm", "d", "plate behind the sensor", 0.0, 0.0, 1.0),)

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {"slave_position": lambda x, q: x + q.position_play}

    def after_step(self, model: Any, x: ca.SX, u0: ca.SX, u: ca.SX, g: Gains) -> ca.SX:
        """The play operator.

        Written with comparisons, not with min and max: at zero play their derivative would be
        half of each side's.
        """
        row, column = model.state("position_play"), model.input("slave_position")
        moved = x[row] - (u[column] - u0[column])
        mapped = ca.SX(x)
        mapped[row] = ca.if_else(
            moved < -g.play, -g.play, ca.if_else(moved > g.play, g.play, moved)
        )
        return mapped
