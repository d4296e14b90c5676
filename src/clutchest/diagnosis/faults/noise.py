"""A signal with more noise than stated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clutchest.diagnosis.faults.messages import fluctuating
from clutchest.diagnosis.faults.stream_test import Alarm, Batch, StreamTest
from clutchest.diagnosis.sequential import new_tail, tail_bound, tail_mean, tail_take
from clutchest.shown import with_unit
from clutchest.signals import Floats
from clutchest.vehicle import Vehicle
from clutchest.vehicle.vehicle import SignalMap

ORDER = 4  # of the differences: smooth motion vanishes in them
BLOCK = 50  # differences whose median is one sample of the level
MATTERS = 2.0  # times the usual variance: half of what twice the noise makes
GAP = 3.0  # sample periods
NO_STEP = 0.01  # of the stated noise: rounding of what is computed, not the bus's resolution
SMOOTH = 4.0  # second over fourth differences, both relative to pure noise: more is motion
FAR = 3.0  # standard deviations of an uneven stamp that says nothing of the others
_LONG = np.array([1.0, -4.0, 6.0, -4.0, 1.0])
_SHORT = np.array([1.0, -2.0, 1.0])
# samples over independent ones, of the squares of neighbouring differences
_CORRELATED = np.sum(np.correlate(_LONG, _LONG, "full") ** 2) / np.sum(_LONG**2) ** 2
_MEDIAN = 0.455  # of a chi-square of one degree of freedom


class Noise(StreamTest):
    """CUSUM (Page) of the noise level beyond twice its usual variance; its threshold is the
    estimated tail of this signal's level.

    The level is the median of squared fourth differences over its expectation for the stated
    noise, with or without what uneven stamps make of the mean motion, whichever is smaller: stamps
    may be those of the samples or not.  Where they are partly so, as of a bus whose frames are
    sent unevenly and received late, the expectation contains what neither explains.  Motion
    contributes to the differences too, but more to second ones: blocks in which it does are not
    tested.  Where the vehicle file guesses the noise, the test does not run: a higher level is then
    no evidence of a fault.
    """

    kind, fmi = "noise", 2

    def __init__(self, signal: SignalMap, per_1000h: float, unit: str = "1") -> None:
        super().__init__(signal.name, per_1000h)
        self.std, self.ar, self.unit = signal.noise, signal.noise_ar, unit
        self.guessed = signal.noise_guessed
        self.sum, self.begun = 0.0, 0.0
        self.tail, self.pending = new_tail(1.0), list[float]()
        self.rest = np.zeros((2, 0))
        self.step, self.period, self.blocks = np.inf, 0.0, 0
        self.stamps = _Stamps()

    @classmethod
    def of(cls, vehicle: Vehicle, per_1000h: float) -> Sequence[StreamTest]:
        """See :meth:`StreamTest.of`."""
        units = vehicle.machine.units
        return [
            cls(vehicle.signals[name], per_1000h, units.get(name, "1"))
            for name in fluctuating(vehicle)
        ]

    def take(self, batch: Batch) -> None:
        """See :meth:`StreamTest.take`."""
        if self.guessed or self.subject not in batch.signals:
            return
        signal = batch.signals[self.subject].only_valid()
        time, value = np.concatenate([self.rest, [signal.time, signal.value]], axis=1)
        count = (len(value) - ORDER) // BLOCK
        if count < 1:
            self.rest = np.array([time, value])
            return
        used = count * BLOCK
        self.rest = np.array([time[used:], value[used:]])
        time, value = time[: used + ORDER], value[: used + ORDER]
        gaps, steps = np.diff(time), np.abs(np.diff(value, 2))  # of a value that moves as well
        self.period = self.period or float(np.median(gaps[:BLOCK]))
        steps[steps < NO_STEP * self.std] = np.inf
        step = np.minimum.accumulate(
            np.append(self.step, steps[ORDER - 2 :].reshape(count, BLOCK).min(axis=1))
        )[1:]
        self.step = float(step[-1])
        long, short = _differences(time, value, count)
        expected = self._expected(_LONG, step), self._expected(_SHORT, step)
        whole = gaps[ORDER - 1 :].reshape(count, BLOCK).max(axis=1) <= GAP * self.period
        calm = whole & (short.least / expected[1] <= SMOOTH * long.least / expected[0])
        unknown = self.stamps.unknown(long, expected[0], calm)
        level, curved = (
            d.least / (e + unknown * np.median(d.moved**2, axis=1))
            for d, e in zip((long, short), expected, strict=True)
        )
        begin, end = time[:used:BLOCK], time[BLOCK + ORDER - 1 :: BLOCK]
        for k in np.flatnonzero(whole & (curved <= SMOOTH * level)).tolist():
            self._test(float(begin[k]), float(end[k]), float(level[k]))

    def _test(self, begin: float, end: float, level: float) -> None:
        """Test one more block, from ``begin`` to ``end`` s."""
        self.blocks += 1
        self.enabled += BLOCK * self.period
        if self.sum <= 0.0:
            self.sum, self.begun = 0.0, begin
        bound = self._bound()
        self.sum = min(self.sum + level - MATTERS * tail_mean(self.tail), 2.0 * bound)
        if self.failing:
            if self.sum <= 0.0:
                self.heal(end)
            return
        self.pending.append(max(level, 1.0))  # enters the tail once known to be healthy
        if self.sum <= 0.0:
            for usual in self.pending:
                tail_take(self.tail, usual)
            self.pending.clear()
        elif self.sum > bound:
            times = np.sqrt(np.mean(self.pending))
            self.pending.clear()
            self.fail(Alarm(self.begun, end, what=f"{times:.2g} times the stated noise"))

    def _expected(self, weights: Floats, step: Floats) -> Floats:
        """Median of a squared difference by the stated noise and the bus's ``step`` (n)."""
        step = np.where(np.isfinite(step), step, 0.0)
        noise = _variance(weights, self.ar) * self.std**2
        return _MEDIAN * (noise + float(weights @ weights) * step**2 / 12.0)

    def _bound(self) -> float:
        blocks = 3.6e6 / (BLOCK * max(self.period, 1e-6)) / self.per_1000h
        return float(tail_bound(self.tail, blocks))

    @property
    def threshold(self) -> float | None:
        """See :meth:`StreamTest.threshold`; a sum of relative variances."""
        return self._bound() if self.blocks else None

    @property
    def why(self) -> str:
        """See :meth:`StreamTest.why`."""
        if self.guessed:
            return (
                f"its noise, {with_unit(f'{self.std:.3g}', self.unit)}, is a guess of the vehicle "
                "file: `clutchest identify noise` measures it"
            )
        if not self.blocks and not self.rest.size:
            return "no valid sample of it"
        if not self.blocks:
            return "too few samples without motion"
        tested = f"tested over {self.blocks} blocks of {BLOCK} samples"
        stated = with_unit(f"{self.std:.3g}", self.unit)
        return f"limit: twice the variance of the stated noise of {stated}; {tested}"


@dataclass(frozen=True, slots=True)
class _Differences:
    """Differences of one order in blocks (n, BLOCK): those of the ``value``, and what uneven
    stamps make of the mean motion, ``moved``."""

    value: Floats
    moved: Floats

    @property
    def least(self) -> Floats:
        """Median square (n,) of each block, without what the stamps make of it where that is
        less."""
        of = [np.median(d**2, axis=1) for d in (self.value, self.value - self.moved)]
        return np.minimum(*of)


def _differences(time: Floats, value: Floats, count: int) -> tuple[_Differences, _Differences]:
    """Fourth and second differences of ``count`` blocks of samples."""
    speed = (value[ORDER:] - value[:-ORDER]) / np.maximum(time[ORDER:] - time[:-ORDER], 1e-9)

    def of(values: Floats) -> tuple[Floats, Floats]:
        return np.diff(values, ORDER), np.diff(values, 2)[1:-1]

    long, short = (
        _Differences(v.reshape(count, BLOCK), (speed * t).reshape(count, BLOCK))
        for v, t in zip(of(value), of(time), strict=True)
    )
    return long, short


class _Stamps:
    """Which share of the unevenness of time stamps is that of the samples; the rest is that of
    their reception."""

    def __init__(self) -> None:
        # value · moved, moved², value², how many; median moved², and what of differences was left
        self.sums = np.zeros(6)

    def unknown(self, more: _Differences, expected: Floats, calm: NDArray[np.bool_]) -> Floats:
        """The variance of the samples' times, given their stamps, over that of the stamps (n,), by
        what came before each of n more blocks whose noise is ``expected`` (n,).

        It is s(1−s) for a share s, the largest within one standard deviation of it, but no more
        than was left of the differences before.  Only ``calm`` blocks (n,) say something of it.
        """
        value, moved, least = more.value, more.moved, more.least
        level = np.median(moved**2, axis=1)
        usual = calm[:, None] & (moved**2 <= FAR**2 / _MEDIAN * level[:, None])
        parts = np.stack([value * moved, moved**2, value**2, np.ones_like(value)])
        blocks = np.stack([level, least - expected]) * calm
        sums = np.cumsum(np.concatenate([np.sum(parts * usual, axis=2), blocks]), axis=1)
        before = self.sums[:, None] + np.pad(sums, ((0, 0), (1, 0)))
        self.sums = before[:, -1]
        both, stamps, values, count, levels, left = before[:, :-1]
        share = both / np.maximum(stamps, 1e-300)
        rest = np.maximum(values / np.maximum(stamps, 1e-300) - share**2, 0.0)
        std = np.sqrt(rest * _CORRELATED / np.maximum(count, 1.0))
        low, high = (np.clip(share + sign * std, 0.0, 1.0) for sign in (-1.0, 1.0))
        s = np.clip(0.5, low, high)
        most = np.maximum(left, 0.0) / np.maximum(levels, 1e-300)
        return np.where(count > 0, np.minimum(s * (1.0 - s), most), 0.25)


def _variance(weights: Floats, ar: float) -> float:
    """Variance of a difference with these weights of AR(1) noise of variance 1."""
    lags = np.abs(np.subtract.outer(np.arange(len(weights)), np.arange(len(weights))))
    return float(weights @ ar**lags @ weights)
