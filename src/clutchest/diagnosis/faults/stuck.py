"""A signal no longer moves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from clutchest.diagnosis.faults.fault import Batch, StreamTest
from clutchest.diagnosis.faults.messages import lively, moving
from clutchest.diagnosis.faults.repeats import RepeatTest
from clutchest.vehicle import Vehicle


class Stuck(RepeatTest):
    """The same value again and again, where noise alone would move it.

    A speed of nought and a motor at its stop are at rest, and a temperature may stand still: there
    nothing can be told.
    """

    kind, fmi = "stuck", 2

    def __init__(self, subject: str, per_1000h: float, lively: bool) -> None:
        super().__init__(subject, per_1000h)
        self.lively, self.last = lively, np.nan

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

        def what(begun: float, detected: float) -> str:
            value = signal.value[np.searchsorted(signal.time, detected)]
            return f"stays at {value:.6g} {signal.unit}"

        self.judge(signal.time, same, judged, what)

    @property
    def why(self) -> str:
        """See :meth:`StreamTest.why`."""
        if not self.lively:
            return "a temperature may stand still"
        if not self.enabled:
            return "no sample of it away from rest"
        return self.repeats.words()
