"""A signal no longer moves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from clutchest.diagnosis.faults.fault import Alarm, Batch, StreamTest
from clutchest.diagnosis.faults.messages import lively, moving
from clutchest.diagnosis.faults.repeats import Repeats
from clutchest.vehicle import Vehicle


class Stuck(StreamTest):
    """The same value again and again, where noise alone would move it.

    A speed of nought and a motor at its stop are at rest, and a temperature may stand still: there
    nothing can be told.
    """

    kind, fmi = "stuck", 2

    def __init__(self, subject: str, per_1000h: float, lively: bool) -> None:
        super().__init__(subject, per_1000h)
        self.lively, self.repeats, self.last = lively, Repeats(), np.nan

    @classmethod
    def of(cls, vehicle: Vehicle, per_1000h: float) -> Sequence[StreamTest]:
        """See :meth:`StreamTest.of`."""
        moved = lively(vehicle)
        return [cls(name, per_1000h, name in moved) for name in vehicle.signals]

    def take(self, batch: Batch) -> None:
        """See :meth:`StreamTest.take`."""
        if not self.lively or self.subject not in batch.signals:
            return
        signal = batch.signals[self.subject].only_valid()
        if not len(signal):
            return
        same = np.diff(signal.value, prepend=self.last) == 0.0
        self.last = float(signal.value[-1])
        judged = moving(self.subject, signal.value)
        for begun, detected, ended in self.repeats.take(signal.time, same, judged, self.per_1000h):
            if ended < np.inf:
                self.heal(ended)
            else:
                value = signal.value[np.searchsorted(signal.time, detected)]
                self.fail(Alarm(begun, detected, what=f"stays at {value:.6g} {signal.unit}"))
        self.enabled = self.repeats.enabled

    @property
    def threshold(self) -> float | None:
        """See :meth:`StreamTest.threshold`; samples."""
        return self.repeats.bound if self.enabled else None

    @property
    def why(self) -> str:
        """See :meth:`StreamTest.why`."""
        if not self.lively:
            return "a temperature may stand still"
        if not self.enabled:
            return "no sample of it away from rest"
        return self.repeats.words()
