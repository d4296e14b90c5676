"""Another inertia than assumed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.models.effects.effect import Effect, Gains, Number, Wording


class EngineInertia(Effect):
    """J_e × (1 + ``change``)."""

    name = "engine_inertia"
    model = "dry_clutch"
    equation = "engine_speed"
    parameters = (Number("change", "1", -0.4, 0.4),)
    wording = {
        "change": Wording(
            "engine inertia is {:.3g} % smaller", "engine inertia is {:.3g} % larger", 100.0
        )
    }

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {
            "engine_inertia": lambda inertia, q: inertia * (1 + g.change),
        }
