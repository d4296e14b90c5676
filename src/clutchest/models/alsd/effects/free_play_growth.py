"""A worn pack."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.models.effects.effect import Effect, Gains, Number


class FreePlayGrowth(Effect):
    """x_fp is ``growth`` wider from the start and grows by ``rate`` per MJ of slip energy.

    Source: wear in proportion to dissipated energy is Archard's law.
    """

    name = "free_play_growth"
    model = "alsd"
    equation = "axial_force"
    parameters = (
        Number("growth", "m", 0.0, 3e-4),
        Number("rate", "m/MJ", 0.0, 1e-3),
    )

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {
            "initial_free_play": lambda play, q: play + g.growth,
            "free_play_rate": lambda rate, q: rate + g.rate * 1e-6 * q.power,
        }
