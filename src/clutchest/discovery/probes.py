"""Probes: an error of one equation, of any size at any time, as an effect of one gain."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from clutchest.models import errors_of
from clutchest.models.effects import Effect, Gains, Number

PREFIX = "error in "  # of a probe's name, before its equation


def probes(model: str) -> tuple[Effect, ...]:
    """One effect per equation that can be wrong, its gain in units of a plausible error."""
    changes, late = errors_of(model)
    terms = [_probe(model, equation, of, {}) for equation, of in changes.items()]
    return (
        *terms,
        *(_probe(model, f"timing:{signal}", {}, {signal: unit}) for signal, unit in late.items()),
    )


def _probe(
    of_model: str,
    of_equation: str,
    changes: Mapping[str, Callable[[Any, Any], Any]],
    late: Mapping[str, float],
) -> Effect:
    size = next(iter(late.values()), 1.0)

    class Probe(Effect):
        """An error of one equation."""

        name = PREFIX + of_equation
        model = of_model
        equation = of_equation
        parameters = (Number("size", "s" if late else "1", -size, size),)
        delays = dict.fromkeys(late, "size")

        def terms(self, g: Gains) -> Mapping[str, Any]:
            return {
                quantity: lambda value, q, change=change: change(value, g.size)
                for quantity, change in changes.items()
            }

    return Probe()
