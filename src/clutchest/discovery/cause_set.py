"""Causes acting together, fitted to the data."""

from __future__ import annotations

from dataclasses import dataclass, replace

from clutchest.discovery.candidates import CandidateCause
from clutchest.inference.white_linearisation import Linearisation

PER_SHAPE = 1.0  # of 2 Δ ln L: what the choice among the values of a shape gains by noise alone


@dataclass(frozen=True, slots=True)
class CauseSet:
    """``causes`` acting together; ``cost`` −2 ln(probability) up to a constant.  The ``fit`` may be
    bare."""

    causes: tuple[CandidateCause, ...]
    fit: Linearisation

    @property
    def cost(self) -> float:
        """Of the fit, with what the choice of shapes gains by noise alone."""
        return self.fit.cost + PER_SHAPE * sum(bool(c.shapes) for c in self.causes)

    @property
    def bare(self) -> CauseSet:
        """The same with a bare fit."""
        return replace(self, fit=self.fit.bare)

    @property
    def names(self) -> frozenset[str]:
        """Names of the effects."""
        return frozenset(c.name for c in self.causes)

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects, each once, in order."""
        return tuple(dict.fromkeys(c.name for c in self.causes))


def cost_of(causes: CauseSet) -> float:
    """As a key of sorting."""
    return causes.cost
