"""The last runs of a drive, so that the same numbers at the same operating point are run once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clutchest.inference.innovations import NormalisedInnovations
from clutchest.inference.operating_point import ModelNumbers, OperatingPoint
from clutchest.signals import Floats

KEPT = 4  # a fit asks twice where its numbers put the inputs, then for derivatives there


@dataclass(frozen=True, slots=True)
class _Run:
    """Innovations at these ``numbers`` and input ``corrections``, by index of the input; with
    derivatives by the ``wanted`` thetas (m)."""

    numbers: ModelNumbers
    corrections: Mapping[int, Floats]
    wanted: NDArray[np.bool_]
    innovations: NormalisedInnovations

    def serves(self, numbers: ModelNumbers, corrections: Mapping[int, Floats]) -> bool:
        """Whether it was made there."""
        return (
            numbers.late == self.numbers.late
            and corrections.keys() == self.corrections.keys()
            and all(map(np.array_equal, numbers[:3], self.numbers[:3]))
            and all(np.array_equal(corrections[j], by) for j, by in self.corrections.items())
        )


class LastRuns:
    """What runs of one drive gave last: a function's arguments and values, nothing else.

    Of derivatives, the largest part, those of one run are kept.
    """

    def __init__(self) -> None:
        self._runs: tuple[_Run, ...] = ()

    def at(
        self, numbers: ModelNumbers, point: OperatingPoint, wanted: NDArray[np.bool_]
    ) -> NormalisedInnovations | None:
        """A copy of the innovations there, with derivatives by the ``wanted`` thetas (m), if these
        are known."""
        for run in self._runs:
            enough = not (wanted & ~run.wanted).any()
            if enough and run.serves(numbers, point.corrections):
                return run.innovations.only(np.flatnonzero(wanted))
        return None

    def keep(
        self,
        numbers: ModelNumbers,
        point: OperatingPoint,
        wanted: NDArray[np.bool_],
        innovations: NormalisedInnovations,
    ) -> None:
        """Remember a copy of these innovations."""
        others = [run for run in self._runs if not (wanted.any() and run.wanted.any())]
        copy = innovations.only(np.flatnonzero(wanted))
        new = _Run(numbers, point.corrections, wanted.copy(), copy)
        self._runs = (*others, new)[-KEPT:]
