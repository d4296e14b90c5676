"""The slave piston does not follow the actuator's motor."""

from __future__ import annotations

from collections.abc import Sequence
from math import log

import numpy as np

from clutchest.diagnosis.faults.fault import Alarm, Batch, StreamTest
from clutchest.diagnosis.sequential import cusum
from clutchest.vehicle import Vehicle

AWAY = 1.5  # mm from its stop, where the fluid is trapped between motor and piston
MOVED = 6.0  # standard deviations: the motor has surely moved
LONGEST = 3.0  # s in which it must have


class Sticking(StreamTest):
    """Likelihood ratio of "the piston stays where it is" to "it moves with the motor", from one
    move of the motor to the next; a threshold of ln(moves) by Lorden's inequality."""

    kind, fmi = "sticking", 7
    harmless = True

    def __init__(self, per_1000h: float, std: float) -> None:
        super().__init__("actuator", per_1000h)
        self.std, self.level, self.begun, self.count = std, 0.0, 0.0, 0
        self.last: tuple[float, float, float] | None = None

    @classmethod
    def of(cls, vehicle: Vehicle, per_1000h: float) -> Sequence[StreamTest]:
        """See :meth:`StreamTest.of`."""
        if not {"slave_position", "motor_position"} <= set(vehicle.signals):
            return []
        slave, motor = (vehicle.signals[n].noise for n in ("slave_position", "motor_position"))
        return [cls(per_1000h, float(np.hypot(slave, motor)))]

    def take(self, batch: Batch) -> None:
        """See :meth:`StreamTest.take`."""
        if not {"slave_position", "motor_position"} <= set(batch.signals):
            return
        slave = batch.signals["slave_position"].only_valid()
        motor = batch.signals["motor_position"].only_valid()
        if not len(slave) or not len(motor):
            return
        pairs = []  # (begin, end, moved by the motor, by the piston)
        for t, s, m in zip(
            slave.time.tolist(),
            slave.value.tolist(),
            np.interp(slave.time, motor.time, motor.value).tolist(),
            strict=True,
        ):
            before = self.last
            if before is None or t - before[0] > LONGEST or min(m, before[2]) < AWAY:
                self.last = t, s, m
            elif abs(m - before[2]) > MOVED * np.sqrt(2.0) * self.std:
                pairs.append((before[0], t, m - before[2], s - before[1]))
                self.last = t, s, m
        if not pairs:
            return
        begin, end, asked, moved = np.array(pairs).T
        self.enabled += float((end - begin).sum())
        self.count += len(pairs)
        variance = 2.0 * self.std**2
        gains = ((moved - asked) ** 2 - moved**2) / (2.0 * variance)
        gains = np.clip(gains, -self._bound() / 2.0, self._bound() / 2.0)
        path, begun = np.zeros(len(gains)), np.zeros(len(gains), np.int64)
        self.level = min(cusum(gains, self.level, path, begun), 2.0 * self._bound())
        for k in range(len(path)):
            if path[k] > self._bound() and not self.failing:
                first = begin[begun[k]] if begun[k] >= 0 else self.begun
                rows = slice(max(int(begun[k]), 0), k + 1)
                self.fail(
                    Alarm(
                        float(first),
                        float(end[k]),
                        what=f"the motor moved "
                        f"{np.abs(asked[rows]).sum():.2g} mm, the piston "
                        f"{np.abs(moved[rows]).sum():.2g} mm",
                    )
                )
            elif path[k] <= 0.0:
                self.heal(float(end[k]))
        if begun[-1] >= 0:
            self.begun = float(begin[begun[-1]])

    def _bound(self) -> float:
        moves = self.count / max(self.enabled, 1.0)
        return log(max(3.6e6 * moves / self.per_1000h, 2.0))

    @property
    def threshold(self) -> float | None:
        """See :meth:`StreamTest.threshold`; a log-likelihood ratio."""
        return self._bound() if self.count else None

    @property
    def why(self) -> str:
        """See :meth:`StreamTest.why`."""
        if not self.count:
            return "the motor never moved away from its stop"
        return f"piston against motor over {self.count} moves of the motor"
