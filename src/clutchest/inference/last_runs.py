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

HELD = 9e6  # numbers that kept runs hold: of an hour, derivatives by what is free, once
PATHS = 8  # a cause, its rivals and the model without one are come back to in turns
ENTRIES = 6e6  # of paths that are kept: of an hour, none


@dataclass(frozen=True, slots=True, eq=False)
class _Run:
    """Innovations at these ``numbers`` and input ``corrections``, by index of the input; with
    derivatives by the ``wanted`` thetas (m)."""

    numbers: ModelNumbers
    corrections: Mapping[int, Floats]
    wanted: NDArray[np.bool_]
    innovations: NormalisedInnovations

    @property
    def size(self) -> int:
        """How many numbers it holds."""
        at = self.innovations.implied
        return self.innovations.table.size + at.states.size + at.inputs.size

    def serves(self, numbers: ModelNumbers, corrections: Mapping[int, Floats]) -> bool:
        """Whether it was made there."""
        return (
            _same(numbers, self.numbers)
            and corrections.keys() == self.corrections.keys()
            and all(np.array_equal(corrections[j], by) for j, by in self.corrections.items())
        )


class LastRuns:
    """What runs of one drive gave last, as many as memory holds: a function's arguments and values,
    nothing else."""

    def __init__(self) -> None:
        self._runs: tuple[_Run, ...] = ()

    def at(
        self, numbers: ModelNumbers, point: OperatingPoint, wanted: NDArray[np.bool_]
    ) -> NormalisedInnovations | None:
        """The innovations there, with derivatives by the ``wanted`` thetas (m), if these are
        known."""
        for run in reversed(self._runs):
            enough = not (wanted & ~run.wanted).any()
            if enough and run.serves(numbers, point.corrections):
                self._last(run)
                return run.innovations.only(np.flatnonzero(wanted))
        return None

    def keep(
        self,
        numbers: ModelNumbers,
        point: OperatingPoint,
        wanted: NDArray[np.bool_],
        innovations: NormalisedInnovations,
    ) -> None:
        """Remember these innovations, which nobody can change from here on; not where their
        derivatives alone are too much: then they are his who asked for them."""
        run = _Run(numbers, point.corrections, wanted.copy(), innovations)
        if wanted.any() and run.size > HELD:
            return
        innovations.table.setflags(write=False)
        self._last(run)

    def _last(self, run: _Run) -> None:
        """Put a run behind the others, and forget what is too much: first, the oldest of those
        without derivatives, which take a third of the time."""
        others = [other for other in self._runs if other is not run]
        spare = sorted(others, key=lambda other: other.wanted.any())
        while spare and sum(other.size for other in spare) > HELD - run.size:
            spare.pop(0)
        self._runs = (*(other for other in others if other in spare), run)


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
