"""The reset spring has set."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.models.effects.effect import Effect, Gains, Number


class SpringPreload(Effect):
    """s_0 × (1 + ``change``)."""

    name = "spring_preload"
    model = "alsd"
    equation = "axial_force"
    parameters = (Number("change", "1", -0.5, 0.5),)

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {"spring_preload": lambda value, q: value * (1 + g.change)}
