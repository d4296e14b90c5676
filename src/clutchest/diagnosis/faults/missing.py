"""A message that is no longer sent."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from clutchest.diagnosis.faults.messages import messages_of
from clutchest.diagnosis.faults.stream_test import Alarm, Batch, StreamTest
from clutchest.diagnosis.sequential import (
    COUNT,
    EXCEEDING,
    new_tail,
    tail_bound,
    tail_mean,
    tail_take,
)
from clutchest.native import compiled
from clutchest.signals import Floats
from clutchest.vehicle import Vehicle

PRIOR_PERIOD = 1.0  # s, of a message that states no period, before its first frame


class Missing(StreamTest):
    """No frame for longer than the estimated tail of this message's gaps."""

    kind, fmi = "missing", 9
    of_message = True
    masked_by = ("silent",)

    def __init__(self, subject: str, per_1000h: float) -> None:
        super().__init__(subject, per_1000h)
        self.tail: np.ndarray | None = None
        self.last, self.last_bus_time = 0.0, 0.0

    @classmethod
    def of(cls, vehicle: Vehicle, per_1000h: float) -> Sequence[StreamTest]:
        """See :meth:`StreamTest.of`."""
        return [cls(message, per_1000h) for message in messages_of(vehicle)]

    def take(self, batch: Batch) -> None:
        """See :meth:`StreamTest.take`."""
        traffic, bus_time = batch.traffic[self.subject], batch.bus_time[self.subject]
        if self.tail is None:
            self.tail = new_tail(traffic.period or PRIOR_PERIOD)
        if len(traffic):
            if self.failing:
                self.heal(float(traffic.time[0]))
                self.last, self.last_bus_time = float(traffic.time[0]), float(bus_time[0])
            gaps = np.diff(bus_time, prepend=self.last_bus_time)
            bounds = gap_bounds(gaps, self.tail, self.per_1000h)
            before = np.concatenate([[self.last], traffic.time[:-1]])
            for k in np.flatnonzero(gaps > bounds):
                begun, end = float(before[k]), float(traffic.time[k])
                words = _words(gaps[k], bounds[k])
                self.fail(Alarm(begun, begun + float(bounds[k]), end, what=words))
            self.last, self.last_bus_time = float(traffic.time[-1]), float(bus_time[-1])
        gap, bound = batch.bus_until - self.last_bus_time, self.bound
        if gap > bound and not self.failing:
            self.fail(Alarm(self.last, self.last + bound, what=_words(gap, bound)))
        self.enabled = batch.bus_until

    @property
    def bound(self) -> float:
        """The longest gap, s, that may be chance."""
        assert self.tail is not None
        return longest_gap(self.tail, self.per_1000h)

    @property
    def threshold(self) -> float | None:
        """See :meth:`StreamTest.threshold`; s."""
        return None if self.tail is None else self.bound

    @property
    def why(self) -> str:
        """See :meth:`StreamTest.why`."""
        if self.tail is None:
            return "no frames: these are decoded signals"
        return f"limit: a gap of {tail_words(self.tail, self.per_1000h)}"


def longest_gap(tail: np.ndarray, per_1000h: float) -> float:
    """The longest gap, s, that may be chance, with so many false alarms."""
    return float(tail_bound(tail, 3.6e6 / tail_mean(tail) / per_1000h))


def tail_words(tail: np.ndarray, per_1000h: float) -> str:
    """The longest gap, and what it was estimated from."""
    count, long = int(tail[COUNT]), int(tail[EXCEEDING])
    return (
        f"{longest_gap(tail, per_1000h):.3g} s, estimated from {count} gaps of "
        f"{round(1e3 * tail_mean(tail), 1):g} ms on average, {long} of them unusually long"
    )


def gap_bounds(gaps: Floats, tail: np.ndarray, per_1000h: float) -> Floats:
    """The longest gap that may be chance at each of ``gaps`` (n), s; infinite where one is not
    even unusual.  The ``tail`` takes those that are not longer."""
    bounds = np.zeros(len(gaps))
    _gaps(gaps, tail, per_1000h, bounds)
    return bounds


def _words(gap: float, bound: float) -> str:
    return f"no frame for {gap:.3g} s, expected one within {bound:.3g} s"


@compiled
def _gaps(gaps, tail, per_1000h, bounds):  # type: ignore[no-untyped-def]
    for k in range(len(gaps)):
        mean = tail_mean(tail)
        bounds[k] = np.inf
        if gaps[k] > 3.0 * mean:
            bounds[k] = tail_bound(tail, 3.6e6 / mean / per_1000h)
        if gaps[k] <= bounds[k]:
            tail_take(tail, gaps[k])
