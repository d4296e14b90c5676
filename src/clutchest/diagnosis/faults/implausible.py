"""A signal outside its plausible range."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from math import inf

import numpy as np
from scipy.special import ndtr, ndtri

from clutchest.diagnosis.faults.messages import TEMPERATURE
from clutchest.diagnosis.faults.stream_test import Alarm, Batch, StreamTest
from clutchest.models.symbols import Column
from clutchest.signals import Floats, Why
from clutchest.vehicle import Vehicle

CONSECUTIVE = 3  # samples; a single one is an outlier
_NOISE = np.linspace(-10.0, 10.0, 401)  # of the sample before, in standard deviations
_DENSITY = np.exp(-(_NOISE**2) / 2.0) / np.sqrt(2.0 * np.pi) * (_NOISE[1] - _NOISE[0])


@cache
def _leaps() -> tuple[Floats, Floats]:
    """Differences of so many samples from one, all up or all down, in standard deviations of the
    noise, and −ln of the chance that they are beyond; by a table, as what solves for it loads for
    longer than a diagnosis takes to begin."""
    most = np.linspace(0.0, 2.0 * _NOISE[-1], 401)
    each = ndtr(_NOISE - most[:, None]) ** CONSECUTIVE
    return most, -np.log(2.0 * (each @ _DENSITY))


class Implausible(StreamTest):
    """Three consecutive samples outside the plausible range, changing faster than is plausible, or
    marked as faulty by the sender; range and change are widened by the noise of so many samples at
    the stated false-alarm rate."""

    kind, fmi = "implausible", 2

    def __init__(self, column: Column, noise: float, per_1000h: float) -> None:
        super().__init__(column.name, per_1000h)
        assert column.possible is not None
        self.noise, self.unit = noise, column.unit
        self.low, self.high, self.rate = column.possible
        self.period, self.consecutive = 0.0, 0
        self.begun, self.last = 0.0, (-inf, 0.0)

    @classmethod
    def of(cls, vehicle: Vehicle, per_1000h: float) -> Sequence[StreamTest]:
        """See :meth:`StreamTest.of`; of columns with a declared range."""
        columns = {c.name: c for c in vehicle.machine.columns if c.possible is not None}
        return [
            cls(columns[name], signal.noise, per_1000h)
            for name, signal in vehicle.signals.items()
            if name in columns
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
                self.consecutive = 0
                self.heal(float(time[k]))
                continue
            self.begun = float(time[k]) if not self.consecutive else self.begun
            self.consecutive += 1
            if self.consecutive == CONSECUTIVE and not self.failing:
                what = "marked as faulty" if why[k] else f"{value[k]:.4g} {self.unit}"
                self.fail(Alarm(self.begun, float(time[k]), what=what))

    def _wrong(self, time: Floats, value: Floats, marked: np.ndarray) -> list[bool]:
        margin, leap, wrong = self.margin, self.leap, []
        for t, v, bad in zip(time.tolist(), value.tolist(), marked.tolist(), strict=True):
            outside = bad or not self.low - margin <= v <= self.high + margin
            before, last = self.last
            most = self.rate * (t - before) + leap
            jumped = not bad and before > -inf and abs(v - last) > most
            if not outside and not jumped:
                self.last = t, v  # a jump is measured against the last plausible sample
            wrong.append(bool(outside or jumped))
        return wrong

    @property
    def margin(self) -> float:
        """What noise adds to so many consecutive samples at the stated false-alarm rate."""
        return float(-self.noise * ndtri(self._chance ** (1.0 / CONSECUTIVE)))

    @property
    def leap(self) -> float:
        """What it adds to the differences of so many samples from one and the same sample."""
        most, chance = _leaps()
        return self.noise * float(np.interp(-np.log(self._chance), chance, most))

    @property
    def _chance(self) -> float:
        """Of a false alarm at one sample, by the stated rate."""
        return 1.0 / max(3.6e6 / max(self.period, 1e-3) / self.per_1000h, 10.0)

    @property
    def threshold(self) -> float | None:
        """See :meth:`StreamTest.threshold`; beyond the plausible range, in its unit."""
        return self.margin if self.enabled else None

    @property
    def why(self) -> str:
        """See :meth:`StreamTest.why`."""
        if not self.enabled:
            return "no sample"
        rate = "K" if self.unit == TEMPERATURE else self.unit
        return (
            f"limits: {self.low:g} to {self.high:g} {self.unit}, at most {self.rate:g} {rate} per s"
        )
