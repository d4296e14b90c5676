"""A message that is sent less often than it should be."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from clutchest.diagnosis.faults.messages import messages_of
from clutchest.diagnosis.faults.stream_test import Batch, StreamTest
from clutchest.diagnosis.sequential import (
    COUNT,
    FAILING,
    cusum_step,
    new_tail,
    tail_bound,
    tail_mean,
    tail_take,
)
from clutchest.native import compiled
from clutchest.vehicle import Vehicle

SMALLEST = 0.1  # of the period: the lateness that matters
PRIOR_JITTER = 0.05  # of the period, before any has been observed
FIRST_GAPS = 20  # intervals, at least, whose median is the period where none is stated, and of
FIRST_S = 1.0  # s: a session may begin with frames that have waited for it and come all at once
LOST = 1.75  # periods: a frame was lost rather than late, unless that is the rule
FORGETTING = 0.05  # per frame, of the share of lost frames
LOST_SHARE = FAILING + 1  # of the state: recent share of lost frames


class Late(StreamTest):
    """CUSUM (Page) of the lateness of frames against the stated period, less half of the smallest
    lateness that matters; its threshold is the estimated tail of this message's jitter."""

    kind, fmi = "late", 9
    of_message = harmless = True
    masked_by = ("missing", "silent")

    def __init__(self, subject: str, per_1000h: float) -> None:
        super().__init__(subject, per_1000h)
        self.tail, self.state = new_tail(PRIOR_JITTER), np.zeros(LOST_SHARE + 1)
        self.period: float | None = None
        self.first: list[float] = []
        self.last: float | None = None

    @classmethod
    def of(cls, vehicle: Vehicle, per_1000h: float) -> Sequence[StreamTest]:
        """See :meth:`StreamTest.of`."""
        return [cls(message, per_1000h) for message in messages_of(vehicle)]

    def take(self, batch: Batch) -> None:
        """See :meth:`StreamTest.take`."""
        traffic, bus_time = batch.traffic[self.subject], batch.bus_time[self.subject]
        if not len(traffic):
            return
        gaps = np.diff(bus_time, prepend=bus_time[0] if self.last is None else self.last)
        time = traffic.time
        if self.last is None:
            gaps, time = gaps[1:], time[1:]
        self.last = float(bus_time[-1])
        if self.period is None:
            self.period = traffic.period
        if self.period is None:  # estimated from the first gaps, which are not tested
            spent = np.cumsum(gaps) + sum(self.first)
            few = np.arange(1, len(gaps) + 1) + len(self.first) < FIRST_GAPS
            need = int(np.count_nonzero(few | (spent < FIRST_S))) + 1
            self.first += gaps[:need].tolist()
            if need > len(gaps):
                return
            gaps, time = gaps[need:], time[need:]
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
            f"limit: {self.threshold:.2g} periods of {1e3 * (self.period or 0.0):.4g} ms, summed "
            f"up where one is {100 * SMALLEST:.0f} % and more too long; jitter "
            f"{100 * tail_mean(self.tail):.1f} % on average, from {int(self.tail[COUNT])} frames"
        )


@compiled
def _late(time, ratio, tail, state, count, changes):  # type: ignore[no-untyped-def]
    n = 0
    for k in range(len(time)):
        lost = ratio[k] > LOST
        state[LOST_SHARE] += FORGETTING * (lost - state[LOST_SHARE])
        if lost and state[LOST_SHARE] < 0.5:
            continue
        late = min(ratio[k] - 1.0, 1.0)
        n = cusum_step(state, late - SMALLEST / 2.0, tail_bound(tail, count), time[k], changes, n)
        if not state[FAILING]:
            tail_take(tail, abs(late))
    return n
