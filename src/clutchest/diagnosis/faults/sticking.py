"""An actuator's output that does not follow its drive."""

from __future__ import annotations

from collections.abc import Sequence
from math import log

import numpy as np

from clutchest.diagnosis.faults.stream_test import Alarm, Batch, StreamTest
from clutchest.diagnosis.sequential import cusum
from clutchest.models.fault import Follower
from clutchest.signals import Signal
from clutchest.vehicle import Vehicle

MOVED = 6.0  # standard deviations: a move of the leader beyond doubt
LONGEST_S = 3.0  # s within which it must take place

Move = tuple[float, float, float, float]  # (begin s, end s, leader's and follower's travel)


class Sticking(StreamTest):
    """Likelihood ratio of "the follower stays where it is" to "it moves with its leader", from one
    move of the leader to the next; a threshold of ln(number of moves) by Lorden's inequality."""

    kind, fmi = "sticking", 7
    harmless = True
    masked_by_signal = ("stuck", "noise")

    def __init__(self, vehicle: Vehicle, pair: Follower, per_1000h: float) -> None:
        super().__init__(pair.subject, per_1000h)
        follower, leader = (vehicle.signals[n] for n in (pair.follower, pair.leader))
        self.pair, self.unit = pair, vehicle.machine.units[pair.follower]
        self.signals = (pair.follower, pair.leader)
        self.std = float(np.hypot(follower.noise, leader.noise))
        self.level, self.begun, self.count = 0.0, 0.0, 0
        self.last: tuple[float, float, float] | None = None

    @classmethod
    def of(cls, vehicle: Vehicle, per_1000h: float) -> Sequence[StreamTest]:
        """See :meth:`StreamTest.of`; for every declared pair with both signals."""
        return [
            cls(vehicle, pair, per_1000h)
            for pair in vehicle.machine.followers
            if {pair.follower, pair.leader} <= set(vehicle.signals)
        ]

    def take(self, batch: Batch) -> None:
        """See :meth:`StreamTest.take`."""
        if not set(self.signals) <= set(batch.signals):
            return
        follower = batch.signals[self.pair.follower].only_valid()
        leader = batch.signals[self.pair.leader].only_valid()
        if not len(follower) or not len(leader):
            return
        moves = self._moves(follower, leader)
        if not moves:
            return
        begin, end, commanded, moved = np.array(moves).T
        self.enabled += float((end - begin).sum())
        self.count += len(moves)
        variance = 2.0 * self.std**2
        gains = ((moved - commanded) ** 2 - moved**2) / (2.0 * variance)
        gains = np.clip(gains, -self._bound() / 2.0, self._bound() / 2.0)
        path, begun = np.zeros(len(gains)), np.zeros(len(gains), np.int64)
        self.level = min(cusum(gains, self.level, path, begun), 2.0 * self._bound())
        for k in range(len(path)):
            if path[k] > self._bound() and not self.failing:
                first = begin[begun[k]] if begun[k] >= 0 else self.begun
                rows = slice(max(int(begun[k]), 0), k + 1)
                what = (
                    f"{words(self.pair.leader)} moved by {np.abs(commanded[rows]).sum():.2g} "
                    f"{self.unit}, {words(self.pair.follower)} by "
                    f"{np.abs(moved[rows]).sum():.2g} {self.unit}"
                )
                self.fail(Alarm(float(first), float(end[k]), what=what))
            elif path[k] <= 0.0:
                self.heal(float(end[k]))
        if begun[-1] >= 0:
            self.begun = float(begin[begun[-1]])

    def _moves(self, follower: Signal, leader: Signal) -> list[Move]:
        """The moves of the leader between samples of the follower, beyond its free stroke."""
        moves = []
        for t, f, m in zip(
            follower.time.tolist(),
            follower.value.tolist(),
            np.interp(follower.time, leader.time, leader.value).tolist(),
            strict=True,
        ):
            before = self.last
            if before is None or t - before[0] > LONGEST_S or min(m, before[2]) < self.pair.stroke:
                self.last = t, f, m
            elif abs(m - before[2]) > MOVED * np.sqrt(2.0) * self.std:
                moves.append((before[0], t, m - before[2], f - before[1]))
                self.last = t, f, m
        return moves

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
            return f"{words(self.pair.leader)} never moved beyond its free stroke"
        leader, follower = words(self.pair.leader), words(self.pair.follower)
        return (
            f"limit: a log-likelihood ratio of {self._bound():.1f}; {follower} against {leader}, "
            f"over {self.count} moves"
        )


def words(signal: str) -> str:
    """A canonical name in words."""
    return signal.replace("_", " ")
