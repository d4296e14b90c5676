"""Single frames that are wrong: a sequential test of their share."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from math import ceil, log

import numpy as np
from numpy.typing import NDArray

from clutchest.diagnosis.faults.stream_test import Batch, StreamTest
from clutchest.diagnosis.sequential import FAILING, cusum_step
from clutchest.native import compiled
from clutchest.signals import Traffic
from clutchest.vehicle import Vehicle

FAULTY_SHARE = 0.1  # of wrong frames under the fault hypothesis
PRIOR_FRAMES = 1000.0  # weight of the prior share of wrong frames, half a frame in so many
FRAMES, WRONG = FAILING + 1, FAILING + 2  # of the state: healthy frames so far


class WrongFrames(StreamTest):
    """Bernoulli CUSUM of "one frame in ten is wrong" against the share observed so far; by Lorden's
    inequality a threshold of ln(n) is exceeded at most once in n healthy frames."""

    fmi = 19
    of_message = True

    def __init__(self, subject: str, per_1000h: float) -> None:
        super().__init__(subject, per_1000h)
        self.state, self.period, self.last = np.zeros(WRONG + 1), 0.0, 0.0

    @classmethod
    def of(cls, vehicle: Vehicle, per_1000h: float) -> Sequence[StreamTest]:
        """See :meth:`StreamTest.of`; only messages that the vehicle file lists as checked."""
        return [cls(message, per_1000h) for message in vehicle.checked]

    @abstractmethod
    def wrong(self, traffic: Traffic, bus_time: NDArray) -> tuple[NDArray, NDArray]:
        """Rows that can be tested, and which of them are wrong."""

    def take(self, batch: Batch) -> None:
        """See :meth:`StreamTest.take`."""
        traffic = batch.traffic[self.subject]
        rows, wrong = self.wrong(traffic, batch.bus_time[self.subject])
        if not len(rows):
            return
        time = traffic.time[rows]
        self.enabled = batch.bus_until
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
            return "no frame of this message that can be tested"
        wrong, frames = int(self.state[WRONG]), int(self.state[FRAMES])
        limit = ceil(self._bound() / log(FAULTY_SHARE / _usual(self.state)))
        return f"limit: {limit} wrong frames in a row; {wrong} of {frames} wrong while healthy"


@compiled
def _usual(state):  # type: ignore[no-untyped-def]
    """The share of wrong frames in healthy traffic, as far as seen."""
    return min((state[WRONG] + 0.5) / (state[FRAMES] + PRIOR_FRAMES), FAULTY_SHARE / 2.0)


@compiled
def _bernoulli(time, wrong, state, bound, changes):  # type: ignore[no-untyped-def]
    n = 0
    for k in range(len(time)):
        usual = _usual(state)
        share, before = (FAULTY_SHARE, usual) if wrong[k] else (1.0 - FAULTY_SHARE, 1.0 - usual)
        n = cusum_step(state, np.log(share / before), bound, time[k], changes, n)
        if not state[FAILING]:
            state[FRAMES] += 1.0
            state[WRONG] += wrong[k]
    return n
