"""Error terms as effects: an error of one equation, of any size at any time, with one gain."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.models.effects import Effect, Gains, Number
from clutchest.models.error_terms import ErrorTerm
from clutchest.models.machine import Machine

PREFIX = "error in "  # of an effect's name, before its error term's


def error_term_effects(machine: Machine) -> tuple[Effect, ...]:
    """One effect per way in which an equation can be wrong, its gain in units of a plausible
    error."""
    return tuple(
        _error_term_effect(machine.name, name, error_term)
        for name, error_term in machine.error_terms.items()
    )


def _error_term_effect(of_model: str, of_name: str, error_term: ErrorTerm) -> Effect:
    late, size = error_term.late or ("", 1.0)

    class ErrorTermEffect(Effect):
        """An error of one equation."""

        name = PREFIX + of_name
        model = of_model
        equation = error_term.equation
        parameters = (Number("size", "s" if late else "1", -size, size),)
        delays = {late: "size"} if late else {}

        def terms(self, g: Gains) -> Mapping[str, Any]:
            return {
                quantity: lambda value, q, change=change: change(value, g.size)
                for quantity, change in error_term.changes.items()
            }

    return ErrorTermEffect()
