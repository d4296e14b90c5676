"""Where equations are linearised: numbers, and the states and inputs that they imply."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from clutchest.signals import Floats


class ModelNumbers(NamedTuple):
    """``parameters`` (np) and numbers of ``effects`` (ng) of the equations, the ``first`` states
    (n), and by how many s signals are ``late`` on top of the effects' delays."""

    parameters: Floats
    effects: Floats
    first: Floats
    late: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class OperatingPoint:
    """What numbers imply of one drive, at every event (K).

    ``states`` (K, n); ``inputs`` (K, nu) as they must have been for the tracked states to move as
    measured; ``corrections``: index of an input → by how much (K) that is off its reading, for
    inputs that are off at all.
    """

    states: Floats
    inputs: Floats
    corrections: Mapping[int, Floats]

    def first(self, count: int) -> OperatingPoint:
        """That of the first so many events."""
        corrections = {j: by[:count] for j, by in self.corrections.items()}
        return OperatingPoint(self.states[:count], self.inputs[:count], corrections)
