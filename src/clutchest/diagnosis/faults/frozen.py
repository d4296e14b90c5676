"""A message comes, but says the same again and again."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from clutchest.diagnosis.faults.fault import Alarm, Batch, StreamTest
from clutchest.diagnosis.faults.messages import lively, messages_of, moving
from clutchest.diagnosis.faults.repeats import Repeats
from clutchest.vehicle import Vehicle


class Frozen(StreamTest):
    """The payload, counter and checksum left out, repeats for longer than it does in health."""

    kind, fmi = "frozen", 19

    def __init__(self, subject: str, per_1000h: float, carries: Sequence[str]) -> None:
        super().__init__(subject, per_1000h)
        self.carries, self.repeats = tuple(carries), Repeats()

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
        for begun, detected, ended in self.repeats.take(
            traffic.time, traffic.same, judged, self.per_1000h
        ):
            if ended < np.inf:
                self.heal(ended)
            else:
                count = round((detected - begun) / max(self.repeats.state[4], 1e-9)
                              * self.repeats.state[3])  # fmt: skip
                self.fail(Alarm(begun, detected, what=f"{count + 1} equal payloads on end"))
        self.enabled = self.repeats.enabled

    @property
    def threshold(self) -> float | None:
        """See :meth:`StreamTest.threshold`; frames."""
        return self.repeats.bound if self.enabled else None

    @property
    def why(self) -> str:
        """See :meth:`StreamTest.why`."""
        if not self.carries:
            return "nothing in this message is bound to change from frame to frame"
        if not self.enabled:
            return "no frame in which anything moved"
        return self.repeats.words().replace("samples", "payloads")
