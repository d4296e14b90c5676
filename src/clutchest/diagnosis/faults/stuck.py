"""A signal that no longer changes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from clutchest.diagnosis.faults.messages import fluctuating, moving, resting
from clutchest.diagnosis.faults.repeats import RepeatTest
from clutchest.diagnosis.faults.stream_test import Batch, StreamTest
from clutchest.vehicle import Vehicle


class Stuck(RepeatTest):
    """Consecutive identical values of a signal that noise alone would change.

    Where a healthy signal may be constant, at standstill or as a slow temperature, it is not
    tested.  Where the vehicle file guesses the noise, how it changes is observed first.
    """

    kind, fmi = "stuck", 2

    def __init__(self, vehicle: Vehicle, subject: str, per_1000h: float) -> None:
        super().__init__(subject, per_1000h, guessed=vehicle.signals[subject].noise_guessed)
        self.fluctuates = subject in fluctuating(vehicle)
        self.rests, self.last = subject in resting(vehicle), np.nan

    @classmethod
    def of(cls, vehicle: Vehicle, per_1000h: float) -> Sequence[StreamTest]:
        """See :meth:`StreamTest.of`."""
        return [cls(vehicle, name, per_1000h) for name in vehicle.signals]

    def take(self, batch: Batch) -> None:
        """See :meth:`StreamTest.take`."""
        if not self.fluctuates or self.subject not in batch.signals:
            return
        signal = batch.signals[self.subject].only_valid()
        if not len(signal):
            return
        same = np.diff(signal.value, prepend=self.last) == 0.0
        self.last = float(signal.value[-1])
        tested = moving(signal.value, self.rests)

        def what(begun: float, detected: float) -> str:
            value = signal.value[np.searchsorted(signal.time, detected)]
            return f"constant at {value:.6g} {signal.unit}"

        self.test(signal.time, same, tested, what)

    @property
    def why(self) -> str:
        """See :meth:`StreamTest.why`."""
        if not self.fluctuates:
            return "a healthy signal of this kind may be constant"
        if np.isnan(self.last):
            return "no valid sample of it"
        if not self.enabled:
            return "no sample of it away from standstill"
        return self.repeats.words("samples")
