"""A message whose payload no longer changes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from clutchest.diagnosis.faults.messages import fluctuating, messages_of, moving, resting
from clutchest.diagnosis.faults.repeats import SAMPLES, SPAN, RepeatTest
from clutchest.diagnosis.faults.stream_test import Batch, StreamTest
from clutchest.vehicle import Vehicle


class Frozen(RepeatTest):
    """The payload, without counter and checksum, repeats for longer than in a healthy vehicle."""

    kind, fmi = "frozen", 19
    of_message = True
    masked_by = ("missing",)

    def __init__(self, vehicle: Vehicle, subject: str, per_1000h: float) -> None:
        super().__init__(subject, per_1000h)
        rests = resting(vehicle)
        self.carried = {
            name: name in rests
            for name in fluctuating(vehicle)
            if vehicle.signals[name].bus.message == subject
        }

    @classmethod
    def of(cls, vehicle: Vehicle, per_1000h: float) -> Sequence[StreamTest]:
        """See :meth:`StreamTest.of`."""
        return [cls(vehicle, message, per_1000h) for message in messages_of(vehicle)]

    def take(self, batch: Batch) -> None:
        """See :meth:`StreamTest.take`."""
        traffic = batch.traffic[self.subject]
        tested = np.zeros(len(traffic), bool)
        for name, rests in self.carried.items():
            if name in batch.signals:
                signal = batch.signals[name].only_valid()
                times = signal.time[moving(signal.value, rests)]
                tested |= np.isin(traffic.time, times)

        def what(begun: float, detected: float) -> str:
            state = self.repeats.state
            count = round((detected - begun) / max(state[SPAN], 1e-9) * state[SAMPLES])
            return f"{count + 1} consecutive identical payloads"

        self.test(traffic.time, traffic.same, tested, what)

    @property
    def why(self) -> str:
        """See :meth:`StreamTest.why`."""
        if not self.carried:
            return "no signal of this message changes from frame to frame in every healthy vehicle"
        if not self.enabled:
            return "no frame in which a signal changed"
        return self.repeats.words("payloads")
