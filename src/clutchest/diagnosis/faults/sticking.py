"""An actuator's output that does not follow its drive."""

from __future__ import annotations

from collections.abc import Sequence
from math import log

import numpy as np

from clutchest.diagnosis.faults.moves import Actuation, Following, Moves
from clutchest.diagnosis.faults.stream_test import Alarm, Batch, StreamTest
from clutchest.diagnosis.sequential import cusum
from clutchest.vehicle import Vehicle


class Sticking(StreamTest):
    """Likelihood ratio of "the follower stays where it is" to "it moves as it must", from one move
    of its leader to the next; a threshold of ln(number of moves) by Lorden's inequality."""

    kind, fmi = "sticking", 7
    masked_by_signal = ("stuck", "noise")

    def __init__(self, vehicle: Vehicle, moves: Moves, per_1000h: float) -> None:
        super().__init__(moves.subject, per_1000h)
        self.moves, self.harmless = moves, moves.harmless
        self.unit = vehicle.machine.units[moves.follower]
        self.leading_unit = vehicle.machine.units[moves.leader]
        self.signals = (moves.follower, moves.leader)
        self.level, self.begun, self.count = 0.0, 0.0, 0

    @classmethod
    def of(cls, vehicle: Vehicle, per_1000h: float) -> Sequence[StreamTest]:
        """See :meth:`StreamTest.of`; for every declared pair with both signals."""
        machine, mapped = vehicle.machine, vehicle.signals
        moves: list[Moves] = [
            *(
                Following(vehicle, f)
                for f in machine.followers
                if {f.leader, f.follower} <= set(mapped)
            ),
            *(
                Actuation(vehicle, a)
                for a in machine.actuators
                if {a.drive, a.output} <= set(mapped)
            ),
        ]
        return [cls(vehicle, each, per_1000h) for each in moves]

    def take(self, batch: Batch) -> None:
        """See :meth:`StreamTest.take`."""
        if not set(self.signals) <= set(batch.signals):
            return
        follower, leader = (batch.signals[name].only_valid() for name in self.signals)
        if not len(follower) or not len(leader):
            return
        moves = self.moves.take(follower, leader)
        if not moves:
            return
        last, begin, end, asked, least, moved = np.array(moves).T
        self.enabled += float((end - begin).sum())
        self.count += len(moves)
        variance = 2.0 * self.moves.std**2
        gains = ((moved - least) ** 2 - moved**2) / (2.0 * variance)
        most = self._bound() / (self.moves.needed - 1)
        gains = np.clip(gains, -most, most)
        path, begun = np.zeros(len(gains)), np.zeros(len(gains), np.int64)
        self.level = min(cusum(gains, self.level, path, begun), 2.0 * self._bound())
        for k in range(len(path)):
            if path[k] > self._bound() and not self.failing:
                first = last[begun[k]] if begun[k] >= 0 else self.begun
                rows = slice(max(int(begun[k]), 0), k + 1)
                what = (
                    f"{words(self.moves.leader)} changed by {np.abs(asked[rows]).sum():.2g} "
                    f"{self.leading_unit}, {words(self.moves.follower)} by "
                    f"{np.abs(moved[rows]).sum():.2g} {self.unit}"
                )
                self.fail(Alarm(float(first), float(end[k]), what=what))
            elif path[k] <= 0.0:
                self.heal(float(end[k]))
        if begun[-1] >= 0:
            self.begun = float(last[begun[-1]])

    def _bound(self) -> float:
        moves = self.count / max(self.enabled, 1.0)
        return log(max(3.6e6 * moves / self.per_1000h, 2.0))

    @property
    def threshold(self) -> float | None:
        """See :meth:`StreamTest.threshold`; a log-likelihood ratio."""
        return self._bound() if self.count else None

    @property
    def why(self) -> str:
        """See :meth:`StreamTest.why`."""
        if not self.count:
            return f"{words(self.moves.leader)} {self.moves.never}"
        leader, follower = words(self.moves.leader), words(self.moves.follower)
        return (
            f"limit: a log-likelihood ratio of {self._bound():.1f}; {follower} against {leader}, "
            f"over {self.count} moves"
        )


def words(signal: str) -> str:
    """A canonical name in words."""
    return signal.replace("_", " ")
