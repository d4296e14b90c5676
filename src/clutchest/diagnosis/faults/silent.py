"""A whole bus, or one of its channels, on which nothing is sent."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from clutchest.diagnosis.faults.missing import gap_bounds, longest_gap, tail_words
from clutchest.diagnosis.faults.stream_test import Alarm, Batch, StreamTest
from clutchest.diagnosis.sequential import new_tail
from clutchest.signals import Floats
from clutchest.vehicle import Vehicle

PRIOR_GAP = 0.1  # s, of a channel before its first frames
BUS = "bus"


class Silent(StreamTest):
    """No frame of any id for longer than the estimated tail of the gaps between frames.

    The whole bus is silent in gaps of the log, which are known when frames follow: a bus that
    remains silent has been switched off.  A channel is silent while another one is active.  All of
    its ``messages`` are then missing, which is no fault of theirs.
    """

    kind, fmi = "silent", 9
    masked_by = ("silent",)  # a channel by the whole bus

    def __init__(self, subject: str, per_1000h: float) -> None:
        super().__init__(subject, per_1000h)
        self.signals = ()
        self.tail, self.last = new_tail(PRIOR_GAP), 0.0
        self.last_bus_time = 0.0

    @classmethod
    def of(cls, vehicle: Vehicle, per_1000h: float) -> Sequence[StreamTest]:
        """See :meth:`StreamTest.of`; of channels only the frames tell which there are."""
        return [cls(BUS, per_1000h)]

    def take(self, batch: Batch) -> None:
        """See :meth:`StreamTest.take`."""
        time = batch.active.get(self.subject, np.zeros(0))
        on_bus = batch.active_bus_time.get(self.subject, time)
        if len(time):
            self.heal(float(time[0]))
            self._test_gaps(time, on_bus)
            self.last, self.last_bus_time = float(time[-1]), float(on_bus[-1])
        silent = batch.bus_until - self.last_bus_time
        if self.subject != BUS and silent > self.bound and self.enabled and not self.failing:
            self.fail(Alarm(self.last, self.last + self.bound, what=_words(silent, self.bound)))

    def _test_gaps(self, time: Floats, on_bus: Floats) -> None:
        first = not self.enabled
        before = np.concatenate([time[:1] if first else [self.last], time[:-1]])
        gaps = np.diff(on_bus, prepend=on_bus[0] if first else self.last_bus_time)
        bounds = gap_bounds(gaps, self.tail, self.per_1000h)
        known = self.alarms[-1].begun if self.alarms else -np.inf
        for k in np.flatnonzero(gaps > bounds):
            begun, end = float(before[k]), float(time[k])
            if begun != known:
                words = _words(gaps[k], bounds[k])
                self.fail(Alarm(begun, begun + float(bounds[k]), end, what=words))
        self.enabled += max(float(gaps.sum()), 1e-9)

    @property
    def bound(self) -> float:
        """The longest silence, s, that may be chance."""
        return longest_gap(self.tail, self.per_1000h)

    @property
    def threshold(self) -> float | None:
        """See :meth:`StreamTest.threshold`; s."""
        return self.bound if self.enabled else None

    @property
    def why(self) -> str:
        """See :meth:`StreamTest.why`."""
        if not self.enabled:
            return "no frames: these are decoded signals"
        return f"limit: a silence of {tail_words(self.tail, self.per_1000h)}"


def _words(gap: float, bound: float) -> str:
    return f"no frame of any id for {gap:.3g} s, expected one within {bound:.3g} s"
