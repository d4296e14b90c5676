"""Frames that are wrong, one by one: a test on how often."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from math import log

import numpy as np
from numba import njit
from numpy.typing import NDArray

from clutchest.diagnosis.faults.fault import Batch, StreamTest
from clutchest.diagnosis.sequential import FAILING, climb
from clutchest.signals import Traffic
from clutchest.vehicle import Vehicle

OFTEN = 0.1  # share of wrong frames that matters
SEEN = 1000.0  # frames that stand for what has not been seen yet: half of one of them wrong
FRAMES, WRONG = FAILING + 1, FAILING + 2  # of the state: healthy ones so far


class WrongFrames(StreamTest):
    """Likelihood ratio of "one frame in ten is wrong" to "as few as so far"; by Lorden's inequality
    a threshold of ln(frames) is exceeded at most once in so many healthy frames."""

    fmi = 19
    of_message = True

    def __init__(self, subject: str, per_1000h: float, has: bool) -> None:
        super().__init__(subject, per_1000h)
        self.has, self.state, self.period, self.last = has, np.zeros(WRONG + 1), 0.0, 0.0

    @classmethod
    def of(cls, vehicle: Vehicle, per_1000h: float) -> Sequence[StreamTest]:
        """See :meth:`StreamTest.of`; only where the vehicle file says that they are checked."""
        return [cls(message, per_1000h, True) for message in vehicle.checked]

    @abstractmethod
    def wrong(self, traffic: Traffic, alive: NDArray) -> tuple[NDArray, NDArray]:
        """Rows that can be judged, and which of them are wrong."""

    def take(self, batch: Batch) -> None:
        """See :meth:`StreamTest.take`."""
        traffic = batch.traffic[self.subject]
        rows, wrong = self.wrong(traffic, batch.alive[self.subject])
        if not len(rows):
            return
        time = traffic.time[rows]
        self.enabled = batch.alive_until
        self.period = self.enabled / max(self.state[FRAMES] + len(rows), 1.0)
        changes = np.zeros((len(rows), 2))
        n = _bernoulli(time, wrong, self.state, self._bound(), changes)
        self.change(
            changes[:n],
            lambda begun, now: (
                f"{int(np.sum(wrong[(time >= begun) & (time <= now)]))} wrong frames"
            ),
        )

    def _bound(self) -> float:
        return log(max(3.6e6 / max(self.period, 1e-6) / self.per_1000h, 2.0))

    @property
    def threshold(self) -> float | None:
        """See :meth:`StreamTest.threshold`; a log-likelihood ratio."""
        return self._bound() if self.enabled else None

    @property
    def why(self) -> str:
        """See :meth:`StreamTest.why`."""
        if not self.enabled:
            return "no frames with one" if self.has else "this message has none"
        return f"{int(self.state[WRONG])} of {int(self.state[FRAMES])} frames wrong while healthy"


@njit(cache=True)
def _bernoulli(time, wrong, state, bound, changes):  # type: ignore[no-untyped-def]
    n = 0
    for k in range(len(time)):
        usual = min((state[WRONG] + 0.5) / (state[FRAMES] + SEEN), OFTEN / 2.0)
        share, before = (OFTEN, usual) if wrong[k] else (1.0 - OFTEN, 1.0 - usual)
        n = climb(state, np.log(share / before), bound, time[k], changes, n)
        if not state[FAILING]:
            state[FRAMES] += 1.0
            state[WRONG] += wrong[k]
    return n
