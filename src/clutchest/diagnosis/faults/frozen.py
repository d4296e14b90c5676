"""A message comes, but says the same again and again."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from clutchest.diagnosis.faults.fault import Batch, StreamTest
from clutchest.diagnosis.faults.messages import lively, messages_of, moving
from clutchest.diagnosis.faults.repeats import SAMPLES, SPAN, RepeatTest
from clutchest.vehicle import Vehicle


class Frozen(RepeatTest):
    """The payload, counter and checksum left out, repeats for longer than it does in health."""

    kind, fmi = "frozen", 19
    of_message = True
    behind = ("missing",)

    def __init__(self, subject: str, per_1000h: float, carries: Sequence[str]) -> None:
        super().__init__(subject, per_1000h)
        self.carries = tuple(carries)

    @classmethod
    def of(cls, vehicle: Vehicle, per_1000h: float) -> Sequence[StreamTest]:
        """See :meth:`StreamTest.of`."""
        carried = {name: vehicle.signals[name].bus.message for name in lively(vehicle)}
        return [
            cls(message, per_1000h, [name for name, m in carried.items() if m == message])
            for message in messages_of(vehicle)
        ]

    def take(self, batch: Batch) -> None:
        """See :meth:`StreamTest.take`."""
        traffic = batch.traffic[self.subject]
        judged = np.zeros(len(traffic), bool)
        for name in self.carries:
            if name in batch.signals:
                signal = batch.signals[name].only_valid()
                alive = signal.time[moving(name, signal.value)]
                judged |= np.isin(traffic.time, alive)

        def what(begun: float, detected: float) -> str:
            state = self.repeats.state
            count = round((detected - begun) / max(state[SPAN], 1e-9) * state[SAMPLES])
            return f"{count + 1} equal payloads on end"

        self.judge(traffic.time, traffic.same, judged, what)

    @property
    def why(self) -> str:
        """See :meth:`StreamTest.why`."""
        if not self.carries:
            return "nothing in this message is bound to change from frame to frame"
        if not self.enabled:
            return "no frame in which anything moved"
        return self.repeats.words().replace("samples", "payloads")
