"""The last runs of a drive, so that the same numbers at the same operating point are run once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from clutchest.inference.innovations import NormalisedInnovations
from clutchest.inference.operating_point import ModelNumbers, OperatingPoint
from clutchest.signals import Floats

KEPT = 4  # a fit asks twice where its numbers put the inputs, then for derivatives there
PATHS = 8  # a cause, its rivals and the model without one are come back to in turns
ENTRIES = 6e6  # of paths that are kept: of an hour, none


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
            _same(numbers, self.numbers)
            and corrections.keys() == self.corrections.keys()
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


class StatePath(NamedTuple):
    """Of one run: the ``rows`` (r, n) of states that kernels take (``records.Path``), and the
    ``states`` (events, n) after each event."""

    rows: Floats
    states: Floats


class LastPaths:
    """Where the states went at the last numbers of one drive with its frozen gains: they depend on
    nothing else, and derivatives of any kind need not follow them again."""

    def __init__(self) -> None:
        self._paths: tuple[tuple[ModelNumbers, StatePath], ...] = ()

    def at(self, numbers: ModelNumbers) -> StatePath | None:
        """The path at these numbers, if it is known."""
        for pair in self._paths:
            if _same(numbers, pair[0]):
                self._paths = (*(other for other in self._paths if other is not pair), pair)
                return pair[1]
        return None

    def keep(self, numbers: ModelNumbers, path: StatePath) -> None:
        """Remember a path, which nobody changes."""
        most = min(PATHS, int(ENTRIES / max(path.rows.size, 1)))
        self._paths = (*self._paths, (numbers, path))[-most:] if most > 1 else ()


def _same(one: ModelNumbers, other: ModelNumbers) -> bool:
    return one.late == other.late and all(map(np.array_equal, one[:3], other[:3]))
