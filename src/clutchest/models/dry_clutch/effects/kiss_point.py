"""A shifted kiss point."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.models.effects.effect import Effect, Gains, Number


class KissPoint(Effect):
    """x_ISP + ``shift``."""

    name = "kiss_point"
    model = "dry_clutch"
    equation = "torque"
    parameters = (Number("shift", "mm", -1.0, 1.0),)

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {
            "kiss_point": lambda x_isp, q: x_isp + g.shift,
        }
