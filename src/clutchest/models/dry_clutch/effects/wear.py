"""Worn pads."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.models.effects.effect import Effect, Gains, Number


class Wear(Effect):
    """x0_ref lies ``amount`` lower from the start and falls by ``rate`` per MJ of slip energy.

    The torque curve rides along through x_cor (11).  Source: ME12 re-fits x0_ref for each session,
    months apart; wear in proportion to dissipated energy is Archard's law.
    """

    name = "wear"
    model = "dry_clutch"
    equation = "zero_position"
    parameters = (Number("amount", "mm", 0.0, 3.0), Number("rate", "mm/MJ", 0.0, 0.5, healthy=0.05))

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {
            "initial_zero_position": lambda x0, q: x0 - g.amount,
            "zero_position_rate": lambda rate, q: rate - g.rate * 1e-6 * q.power,
        }
