"""A stiffer or softer pack."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.models.effects.effect import Effect, Gains, Number


class PackStiffness(Effect):
    """c_cl.e × (1 + ``change``).

    Source: ID08 used a constant rough value.
    """

    name = "pack_stiffness"
    model = "alsd"
    equation = "axial_force"
    parameters = (Number("change", "1", -0.5, 0.5),)

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {"pack_stiffness": lambda value, q: value * (1 + g.change)}
