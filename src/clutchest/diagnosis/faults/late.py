"""A message comes more seldom than it should."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numba import njit

from clutchest.diagnosis.faults.fault import Batch, StreamTest
from clutchest.diagnosis.faults.messages import messages_of
from clutchest.diagnosis.sequential import (
    COUNT,
    FAILING,
    climb,
    new_tail,
    tail_bound,
    tail_mean,
    tail_take,
)
from clutchest.vehicle import Vehicle

SMALLEST = 0.1  # of the period: the lateness that matters
JITTER = 0.05  # of the period, before any has been seen
LEARN = 20  # intervals whose median is the period where none is stated
LOST = 1.75  # periods: a frame has been lost rather than late, unless it happens all the time
FORGET = 0.05  # of what is known of that, per frame
OFTEN = FAILING + 1  # of the state: how often frames have been lost of late


class Late(StreamTest):
    """Page's sum over the lateness of frames against the stated period, less half of what matters;
    it must leave what the jitter of this message reaches."""

    kind, fmi = "late", 9
    of_message = harmless = True
    behind = ("missing",)

    def __init__(self, subject: str, per_1000h: float) -> None:
        super().__init__(subject, per_1000h)
        self.tail, self.state = new_tail(JITTER), np.zeros(OFTEN + 1)
        self.period: float | None = None
        self.first: list[float] = []
        self.last: float | None = None

    @classmethod
    def of(cls, vehicle: Vehicle, per_1000h: float) -> Sequence[StreamTest]:
        """See :meth:`StreamTest.of`."""
        return [cls(message, per_1000h) for message in messages_of(vehicle)]

    def take(self, batch: Batch) -> None:
        """See :meth:`StreamTest.take`."""
        traffic, alive = batch.traffic[self.subject], batch.alive[self.subject]
        if not len(traffic):
            return
        gaps = np.diff(alive, prepend=alive[0] if self.last is None else self.last)
        time = traffic.time
        if self.last is None:
            gaps, time = gaps[1:], time[1:]
        self.last = float(alive[-1])
        if self.period is None:
            self.period = traffic.period
        if self.period is None:  # learn it, and judge nothing meanwhile
            need = LEARN - len(self.first)
            self.first += gaps[:need].tolist()
            gaps, time = gaps[need:], time[need:]
            if len(self.first) < LEARN:
                return
            self.period = float(np.median(self.first))
        period = self.period
        self.enabled += float(gaps.sum())
        changes = np.zeros((len(gaps), 2))
        n = _late(time, gaps / period, self.tail, self.state, self._count(), changes)

        def what(begun: float, now: float) -> str:
            mean = float(np.mean(gaps[(time >= begun) & (time <= now)]))
            return f"a frame every {1e3 * mean:.3g} ms, expected every {1e3 * period:.3g} ms"

        self.change(changes[:n], what)

    def _count(self) -> float:
        return 3.6e6 / (self.period or 1.0) / self.per_1000h

    @property
    def threshold(self) -> float | None:
        """See :meth:`StreamTest.threshold`; periods."""
        return float(tail_bound(self.tail, self._count())) if self.enabled else None

    @property
    def why(self) -> str:
        """See :meth:`StreamTest.why`."""
        if not self.enabled:
            return "too few frames"
        return (
            f"{SMALLEST:.0%} and more beyond a period of {1e3 * (self.period or 0.0):.4g} ms, "
            f"added up to {self.threshold:.2g} periods; jitter {tail_mean(self.tail):.1%} "
            f"on average, from {int(self.tail[COUNT])} frames"
        )


@njit(cache=True)
def _late(time, ratio, tail, state, count, changes):  # type: ignore[no-untyped-def]
    n = 0
    for k in range(len(time)):
        lost = ratio[k] > LOST
        state[OFTEN] += FORGET * (lost - state[OFTEN])
        if lost and state[OFTEN] < 0.5:
            continue
        late = min(ratio[k] - 1.0, 1.0)
        n = climb(state, late - SMALLEST / 2.0, tail_bound(tail, count), time[k], changes, n)
        if not state[FAILING]:
            tail_take(tail, abs(late))
    return n
