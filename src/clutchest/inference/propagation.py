"""One run of the filter along a drive, with responses to unknowns; a long one in two halves at the
same time.

Responses are linear in what they begin with: those of the second half follow from where the first
one ends by the responses to the states between them, which take a column each.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from clutchest.compute.records import (
    ActiveThetas,
    Denoised,
    Numbers,
    Sensitivities,
    Start,
    Tracking,
)
from clutchest.estimate.whole_log import events_of, regimes_of
from clutchest.inference.cores import halved, shared
from clutchest.inference.operating_point import ModelNumbers
from clutchest.inference.prepared_drive import FrozenGains, PreparedDrive
from clutchest.native import compiled
from clutchest.signals import Floats


class Derivatives(NamedTuple):
    """Where derivatives of the innovations (K) are put: that by each of the active thetas (a) into
    column ``place`` (a) of a ``table`` (K, ≥ a)."""

    table: Floats
    place: NDArray[np.int64]

    @classmethod
    def of(cls, drive: PreparedDrive, count: int) -> Derivatives:
        """A table of so many columns, side by side."""
        return cls(np.zeros((len(drive.readings.event), count)), np.arange(count))


class Modulation(NamedTuple):
    """Of the thetas whose derivatives are taken, c acts in proportion to column ``column[c]`` of
    the ``basis`` (events, b); fully where that is −1."""

    basis: Floats
    column: NDArray[np.int64]


class PropagatedInputs(NamedTuple):
    """What a propagation takes in at every event: (events, nu) each."""

    measured: Floats
    expected: Floats
    slope: Floats
    moves: Floats


class Propagation(NamedTuple):
    """A ``drive`` at some ``numbers``, with its ``inputs`` and ``gains``, which are filled unless
    they are ``frozen``."""

    drive: PreparedDrive
    numbers: ModelNumbers
    inputs: PropagatedInputs
    gains: FrozenGains
    frozen: bool

    def run(
        self, active: NDArray[np.int64], modulation: Modulation, into: Derivatives
    ) -> tuple[Floats, Floats]:
        """Innovations (K) and states (events, n); derivatives by the ``active`` thetas (a) are
        filled in."""
        events = len(self.drive.line.t)
        if self.frozen and len(active) and halved(events):
            return self._in_halves(events // 2, active, modulation, into)
        every = np.arange(len(self.drive.readings.event))
        done = self._piece(slice(None), every, active, modulation, into, self._start(active))
        return done.innovation, done.x

    def _in_halves(
        self, middle: int, active: NDArray[np.int64], modulation: Modulation, into: Derivatives
    ) -> tuple[Floats, Floats]:
        """The same, the events before the ``middle`` one beside the others."""
        later = self.drive.readings.event >= middle
        early = slice(None, middle), np.where(later, -1, np.arange(len(later)))
        late = slice(middle - 1, None), np.where(later, np.cumsum(later) - 1, -1)
        none = np.zeros(0, np.int64)
        nothing = Modulation(modulation.basis[:, :0], none), Derivatives(into.table[:, :0], none)
        at_middle, start = self._start(none), self._start(active)
        self._piece(*early, none, *nothing, at_middle)
        n, count = len(at_middle.x), len(active)
        # responses from nothing on, and those to the states in the middle
        still = np.column_stack([modulation.basis, np.zeros(len(modulation.basis))])
        column = np.append(modulation.column, np.full(n, still.shape[1] - 1))
        table = np.zeros((np.count_nonzero(later), count + n))
        from_middle = (
            *late,
            np.append(active, np.zeros(n, np.int64)),
            Modulation(still, column),
            Derivatives(table, np.arange(count + n)),
            at_middle._replace(S=np.column_stack([np.zeros((n, count)), np.eye(n)])),
        )
        pieces = ((*early, active, modulation, into, start), from_middle)
        first, second = shared(lambda piece: self._piece(*piece), pieces)
        _join(into.table, into.place, np.flatnonzero(later), table, start.S)
        first.innovation[later] = second.innovation[: len(table)]
        return first.innovation, np.concatenate([first.x, second.x[1:]])

    @property
    def _at_once(self) -> NDArray[np.int64]:
        """Of every regime (r), how many steps of the states derivatives take in one; a covariance
        that is carried in long steps may run away."""
        return self.drive.at_once if self.frozen else np.ones_like(self.drive.at_once)

    def _start(self, active: NDArray[np.int64]) -> Start:
        """Where the drive begins."""
        drive, (p, g, first, _) = self.drive, self.numbers
        x, S = np.zeros(len(first)), np.zeros((len(first), len(drive.compiled.thetas)))
        drive.compiled.functions.initial(first, p, g, x, S)
        x = np.where(drive.tracked.which, drive.start.x, x)
        return Start(x, x.copy(), drive.start.P.copy(), S[:, active].copy())

    def _piece(
        self,
        piece: slice,
        row: NDArray[np.int64],
        active: NDArray[np.int64],
        modulation: Modulation,
        into: Derivatives,
        start: Start,
    ) -> Sensitivities:
        """A piece of the events, of whose readings each goes to its ``row`` (K) of the results, if
        it has one.  The ``start`` is moved to its end; the first event only leads to the others
        where it is not the drive's own."""
        drive, inputs, functions = self.drive, self.inputs, self.drive.compiled.functions
        emit = np.full(len(drive.line.t), -1)
        emit[drive.readings.event] = row
        events = events_of(drive.line, piece, taken=bool(piece.start))
        events = events._replace(u=inputs.measured[piece], emit=emit[piece])
        results = Sensitivities(
            np.zeros((len(events.t), len(start.x))), np.zeros(len(row)), into.table
        )
        functions.filter_sensitivities(
            start,
            ActiveThetas(
                active,
                modulation.basis[piece],
                modulation.column,
                into.place,
                self._at_once,
            ),
            events,
            Denoised(
                inputs.expected[piece],
                inputs.slope[piece],
                inputs.moves[piece],
                drive.tracked.value[piece],
            ),
            drive.varying._replace(value=drive.varying.value[piece]),
            Tracking(
                np.flatnonzero(drive.tracked.which),
                self.gains.gain[piece],
                self.gains.variance[piece],
                self.frozen,
                drive.tracked.settling,
            ),
            regimes_of(drive.line),
            Numbers(self.numbers.parameters, self.numbers.effects.copy()),
            results,
            functions.sensitivity_workspace(len(active)),
        )
        return results


@compiled
def _join(
    table: Floats, place: NDArray[np.int64], rows: NDArray[np.int64], later: Floats, S: Floats
) -> None:
    """Rows of a ``table`` ← derivatives (k, a + n) of a later piece by thetas and by the states at
    its start, which respond to the thetas by ``S`` (n, a)."""
    count = len(place)
    for k in range(len(rows)):
        for c in range(count):
            total = later[k, c]
            for i in range(len(S)):
                total += later[k, count + i] * S[i, c]
            table[rows[k], place[c]] = total
