"""Probes: an error of one equation, of any size at any time, as an effect of one gain."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.models import flaws_of
from clutchest.models.effects import Effect, Gains, Number
from clutchest.models.flaws import Flaw

PREFIX = "error in "  # of a probe's name, before its flaw's


def probes(model: str) -> tuple[Effect, ...]:
    """One effect per way in which an equation can be wrong, its gain in units of a plausible
    error."""
    return tuple(_probe(model, name, flaw) for name, flaw in flaws_of(model).items())


def _probe(of_model: str, of_name: str, flaw: Flaw) -> Effect:
    late, size = flaw.late or ("", 1.0)

    class Probe(Effect):
        """An error of one equation."""

        name = PREFIX + of_name
        model = of_model
        equation = flaw.equation
        parameters = (Number("size", "s" if late else "1", -size, size),)
        delays = {late: "size"} if late else {}

        def terms(self, g: Gains) -> Mapping[str, Any]:
            return {
                quantity: lambda value, q, change=change: change(value, g.size)
                for quantity, change in flaw.changes.items()
            }

    return Probe()
