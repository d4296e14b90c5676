"""A steeper or flatter torque curve: the spring's set."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.models.effects.effect import Effect, Gains, Number


class TorqueCurve(Effect):
    """M_ref × (1 + ``change`` · (x_ISP − x_cor))."""

    name = "torque_curve"
    model = "dry_clutch"
    equation = "torque"
    parameters = (Number("change", "1/mm", -0.08, 0.08),)

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {
            "reference_torque": lambda torque, q: torque * (1 - g.change * q.compression),
        }
