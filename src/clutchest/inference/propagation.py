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
    Path,
    Sensitivities,
    Start,
    Tracking,
)
from clutchest.estimate.whole_log import events_of, regimes_of
from clutchest.inference.cores import halved, shared
from clutchest.inference.innovations import NO_DERIVATIVES
from clutchest.inference.last_runs import StatePath
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


class _Responses(NamedTuple):
    """Which responses are followed: by the ``active`` thetas (a), ``modulation``, ``into``."""

    active: NDArray[np.int64]
    modulation: Modulation
    into: Derivatives


class _Piece(NamedTuple):
    """A piece of the ``events``, of whose readings each goes to its ``row`` (K) of the results, if
    it has one; where it starts, and the ``path`` of the states."""

    events: slice
    row: NDArray[np.int64]
    start: Start
    path: Path


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
        responses = _Responses(active, modulation, into)
        if self.frozen and len(active) and halved(events := len(self.drive.line.t)):
            return self._in_halves(events // 2, responses)
        done = self._whole(responses)[0]
        return done.innovation, done.x

    def _whole(self, responses: _Responses) -> tuple[Sensitivities, StatePath]:
        """All events one after the other; the path of the states, which is empty unless gains are
        frozen."""
        paths, n = self.drive.paths, len(self.numbers.first)
        known = paths.at(self.numbers) if self.frozen else None
        rows = self._rows[-1] + 1 if self.frozen and known is None else 0
        path = Path(known.rows if known else np.zeros((rows, n)), known is not None)
        every = np.arange(len(self.drive.readings.event))
        start = self._start(responses)
        done = self._piece(_Piece(slice(None), every, start, path), responses)
        followed = known or StatePath(path.x, done.x)
        if rows and np.any(self._at_once > 1):  # else they take a tenth of the time
            paths.keep(self.numbers, followed)
        return done, followed

    def _in_halves(self, middle: int, responses: _Responses) -> tuple[Floats, Floats]:
        """The same, the events before the ``middle`` one beside the others."""
        active, modulation, into = responses
        known = self.drive.paths.at(self.numbers) or self._whole(_none(self.drive))[1]
        later = self.drive.readings.event >= middle
        early = _Piece(
            slice(None, middle),
            np.where(later, -1, np.arange(len(later))),
            start := self._start(responses),
            Path(known.rows, known=True),
        )
        # responses from nothing on, and those to the states in the middle
        states = known.states[middle - 1]
        n, count = len(states), len(active)
        late = _Piece(
            slice(middle - 1, None),
            np.where(later, np.cumsum(later) - 1, -1),
            start._replace(
                x=states.copy(),
                settled=states.copy(),
                S=np.column_stack([np.zeros((n, count)), np.eye(n)]),
            ),
            Path(known.rows[self._rows[middle - 1] :], known=True),
        )
        still = np.column_stack([modulation.basis, np.zeros(len(modulation.basis))])
        column = np.append(modulation.column, np.full(n, still.shape[1] - 1))
        table = np.zeros((np.count_nonzero(later), count + n))
        from_middle = _Responses(
            np.append(active, np.zeros(n, np.int64)),
            Modulation(still, column),
            Derivatives(table, np.arange(count + n)),
        )
        pieces = ((early, responses), (late, from_middle))
        first, second = shared(lambda piece: self._piece(*piece), pieces)
        _join(into.table, into.place, np.flatnonzero(later), table, start.S)
        first.innovation[later] = second.innovation[: len(table)]
        return first.innovation, np.concatenate([first.x, second.x[1:]])

    @property
    def _at_once(self) -> NDArray[np.int64]:
        """Of every regime (r), how many steps of the states derivatives take in one; a covariance
        that is carried in long steps may run away."""
        return self.drive.at_once if self.frozen else np.ones_like(self.drive.at_once)

    @property
    def _rows(self) -> NDArray[np.int64]:
        """In which row of a path each event (K) is met: rows before it are those of its steps."""
        line = self.drive.line
        steps = np.ceil(np.diff(line.t, prepend=line.t[0]) / line.longest[line.row])
        return np.cumsum(1 + np.ceil(steps / self._at_once[line.row]).astype(np.int64)) - 1

    def _start(self, responses: _Responses) -> Start:
        """Where the drive begins."""
        drive, (p, g, first, _) = self.drive, self.numbers
        active, (basis, column), _ = responses
        g = g.copy()
        g[[each.row for each in drive.later]] = 0.0  # none of them has begun
        x, S = np.zeros(len(first)), np.zeros((len(first), len(drive.compiled.thetas)))
        drive.compiled.functions.initial(first, p, g, x, S)
        x = np.where(drive.tracked.which, drive.start.x, x)
        S = S[:, active]
        S[:, column >= 0] *= basis[0, column[column >= 0]]
        return Start(x, x.copy(), drive.start.P.copy(), S)

    def _piece(self, piece: _Piece, responses: _Responses) -> Sensitivities:
        """Its start is moved to its end; the first event only leads to the others where it is not
        the drive's own."""
        drive, inputs, functions = self.drive, self.inputs, self.drive.compiled.functions
        of, (active, modulation, into) = piece.events, responses
        emit = np.full(len(drive.line.t), -1)
        emit[drive.readings.event] = piece.row
        events = events_of(drive.line, of, taken=bool(of.start))
        events = events._replace(u=inputs.measured[of], emit=emit[of])
        results = Sensitivities(
            np.zeros((len(events.t), len(piece.start.x))), np.zeros(len(piece.row)), into.table
        )
        basis, column = modulation
        functions.filter_sensitivities(
            piece.start,
            ActiveThetas(active, basis[of], column, into.place, self._at_once),
            events,
            Denoised(
                inputs.expected[of], inputs.slope[of], inputs.moves[of], drive.tracked.value[of]
            ),
            drive.varying._replace(value=drive.varying.value[of]),
            Tracking(
                np.flatnonzero(drive.tracked.which),
                self.gains.gain[of],
                self.gains.variance[of],
                self.frozen,
                drive.tracked.settling,
            ),
            regimes_of(drive.line),
            Numbers(self.numbers.parameters, self.numbers.effects.copy()),
            piece.path,
            results,
            functions.sensitivity_workspace(len(active)),
        )
        return results


def _none(drive: PreparedDrive) -> _Responses:
    """No responses at all."""
    nothing = Modulation(np.zeros((len(drive.line.t), 0)), NO_DERIVATIVES)
    return _Responses(NO_DERIVATIVES, nothing, Derivatives.of(drive, 0))


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
