"""A temperature that cannot be."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf

import numpy as np
from scipy.stats import norm

from clutchest.diagnosis.faults.fault import Alarm, Batch, StreamTest
from clutchest.signals import Floats, Why
from clutchest.vehicle import Vehicle

# What nature allows, °C: the lowest, the highest, and how fast it changes at most, K/s.
POSSIBLE: Mapping[str, tuple[float, float, float]] = {
    "coolant_temp": (-50.0, 130.0, 3.0),
    "ambient_temp": (-60.0, 60.0, 2.0),
    "oil_temp": (-50.0, 180.0, 5.0),
    "armature_temp": (-50.0, 250.0, 20.0),
}
ON_END = 3  # samples; a single one is an outlier


class Implausible(StreamTest):
    """Three samples on end outside what nature allows, changing faster than it allows, or marked as
    faulty by the sender; noise is allowed for as far as it reaches once in the stated time."""

    kind, fmi = "implausible", 2

    def __init__(self, subject: str, per_1000h: float, noise: float) -> None:
        super().__init__(subject, per_1000h)
        self.noise, self.period, self.on_end = noise, 0.0, 0
        self.begun, self.last = 0.0, (-inf, 0.0)

    @classmethod
    def of(cls, vehicle: Vehicle, per_1000h: float) -> Sequence[StreamTest]:
        """See :meth:`StreamTest.of`."""
        return [
            cls(name, per_1000h, vehicle.signals[name].noise)
            for name in vehicle.signals
            if name in POSSIBLE
        ]

    def take(self, batch: Batch) -> None:
        """See :meth:`StreamTest.take`."""
        if self.subject not in batch.signals:
            return
        signal = batch.signals[self.subject]
        known = np.isin(signal.why, (Why.VALID, Why.ERROR))
        time, value, why = signal.time[known], signal.value[known], signal.why[known]
        if not len(time):
            return
        if len(time) > 1:
            self.period = float(np.median(np.diff(time)))
        self.enabled += float(np.minimum(np.diff(time), 10.0).sum())
        for k, wrong in enumerate(self._wrong(time, value, why == Why.ERROR)):
            if not wrong:
                self.on_end = 0
                self.heal(float(time[k]))
                continue
            self.begun = float(time[k]) if not self.on_end else self.begun
            self.on_end += 1
            if self.on_end == ON_END and not self.failing:
                told = "marked as faulty" if why[k] else f"{value[k]:.4g} °C"
                self.fail(Alarm(self.begun, float(time[k]), what=told))

    def _wrong(self, time: Floats, value: Floats, marked: np.ndarray) -> list[bool]:
        low, high, fastest = POSSIBLE[self.subject]
        reach, found = self.reach, []
        for t, v, bad in zip(time.tolist(), value.tolist(), marked.tolist(), strict=True):
            outside = bad or not low - reach <= v <= high + reach
            before, last = self.last
            moved = fastest * (t - before) + np.sqrt(2.0) * reach
            jumped = not bad and before > -inf and abs(v - last) > moved
            if not outside and not jumped:
                self.last = t, v  # what it jumped away from stays the measure
            found.append(bool(outside or jumped))
        return found

    @property
    def reach(self) -> float:
        """How far noise carries three samples on end, °C, as seldom as asked for."""
        count = 3.6e6 / max(self.period, 1e-3) / self.per_1000h
        return float(self.noise * norm.isf((1.0 / max(count, 10.0)) ** (1.0 / ON_END)))

    @property
    def threshold(self) -> float | None:
        """See :meth:`StreamTest.threshold`; °C beyond what nature allows."""
        return self.reach if self.enabled else None

    @property
    def why(self) -> str:
        """See :meth:`StreamTest.why`."""
        if not self.enabled:
            return "no sample"
        low, high, fastest = POSSIBLE[self.subject]
        return f"{low:g} to {high:g} °C, at most {fastest:g} K/s"
