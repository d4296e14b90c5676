"""Faults that a machine's equations show."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from clutchest.models.effects.effect import Effect, Number


class ModelFault:
    """A fault that the equations show: one gain of an effect.

    Subclass it in a file of its own.  ``name`` as the output files name it; ``effect`` it is made
    of and ``key`` of its gain; ``size`` the smallest that matters, in the gain's unit; ``fmi``
    J1939's failure mode where it is too much and where it is too little.
    """

    name: ClassVar[str]
    effect: ClassVar[Effect]
    key: ClassVar[str]
    size: ClassVar[float]
    fmi: ClassVar[tuple[int, int]]

    @property
    def number(self) -> Number:
        """The gain: its unit and its largest plausible sizes."""
        return next(n for n in self.effect.gains if n.key == self.key)

    def onset(self, hours: float) -> Mapping[str, float]:
        """Other faults, and how much of each per unit, that this one amounts to less of where it
        begins ``hours`` after the drive."""
        return {}


@dataclass(frozen=True, slots=True)
class Follower:
    """A signal that must move as its ``leader`` does beyond ``stroke`` (the signals' unit); where
    it does not, the ``subject`` sticks."""

    subject: str
    leader: str
    follower: str
    stroke: float
