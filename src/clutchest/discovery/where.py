"""Where an error is: its equation, and what it correlates with."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from clutchest.quantity import Quantity


@dataclass(frozen=True, slots=True)
class Where:
    """The equation that is wrong, and the covariates of its error, best first; ``peak``: it
    correlates with the highest value so far of the first; ``distorted``: the residuals of
    that sensor are not noise, and in which equation the error is they do not say; ``p_value`` of an
    error without a name, family-wise.  ``others``: equations that have an error of their own beside
    it; ``instead``: equations in which it may be as well, each with covariates of its own, as the
    data do not say which; ``tied``: covariates that it may correlate with instead of the first,
    likewise."""

    equation: str
    covariates: tuple[str, ...]
    peak: bool = False
    distorted: bool = False
    p_value: float | None = None
    others: tuple[Where, ...] = ()
    instead: tuple[Where, ...] = ()
    tied: tuple[str, ...] = ()

    @property
    def likeliest(self) -> tuple[str, ...]:
        """The covariates of which one is as likely as any: the first and those tied with it."""
        return (*self.covariates[:1], *self.tied)

    def summary(self) -> dict[str, Any]:
        """As ``discovery.json`` has it."""
        return {"equation": self.equation, "drivers": list(self.covariates), **self._instead}

    @property
    def _instead(self) -> dict[str, Any]:
        """Equations in which it may be as well, and what it may correlate with there."""
        return {
            "instead": [w.equation for w in self.instead],
            "instead_drivers": {w.equation: list(w.likeliest) for w in self.instead},
        }

    @property
    def errors(self) -> list[dict[str, Any]]:
        """Every established error without a name, as ``discovery.json`` has it."""
        each = (self, *self.others)
        return [
            {**w.summary(), "tied": list(w.tied), "p_value": w.p_value}
            for w in each
            if w.p_value is not None
        ]


_PLACE = {"sensor": "the readings of", "timing": "the time stamps of"}


def place_words(equation: str) -> str:
    """Where an error is, in words, by the name of its equation or of its error term: "the equation
    torque", "the readings of engine_torque"."""
    kind, colon, signal = equation.partition(",")[0].partition(":")
    return f"{_PLACE.get(kind, kind)} {signal}" if colon else f"the equation {kind}"


def places_words(where: Where) -> str:
    """Where an error is, or in one of which it is, each with what it correlates with, in words."""
    *others, last = map(place_and_driver, (where, *where.instead))
    return f"{', in '.join(others)} or in {last} (the data do not say in which)" if others else last


def place_and_driver(where: Where) -> str:
    """In words: "the equation torque that correlates with slip speed"."""
    place = place_words(where.equation)
    if not where.covariates:
        return place
    first, *others = (Quantity(name, "1").words for name in where.likeliest)
    words = f" that correlates with {f'the highest {first} so far' if where.peak else first}"
    words += f" (or, as likely, with {' or '.join(others)})" if others else ""
    return f"{place}{words}"
