"""A worn gearbox."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.models.effects.effect import Effect, Gains, Number


class BacklashGrowth(Effect):
    """``growth`` is added to α_b1, half the play at the gearbox output."""

    name = "backlash_growth"
    model = "alsd"
    equation = "axial_force"
    parameters = (Number("growth", "rad", 0.0, 0.05),)

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {"gear_backlash": lambda value, q: value + g.growth}
