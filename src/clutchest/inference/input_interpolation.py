"""Inputs interpolated between their samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter1d

from clutchest.inference.denoising import adaptive_mean
from clutchest.inference.parabolas import parabolas
from clutchest.native import compiled
from clutchest.signals import Floats

WINDOW = 0.1  # s, over which inputs are smoothed
BENDS = 4.0  # standard deviations of its noise, by which an input leaves its smooth value
FIVE = 5  # samples, which show how an input bends
CLOSE = 7  # samples, within which what a state follows bends little
CALM = 2.6  # standard deviations of noise; by more, 5.5 of their own difference, chance makes the
# parabolas through so many differ from the wide ones once in 10⁷ samples
TURNS = 4.0  # standard deviations of that, from which on it is no noise
GAP = 2.0  # sample periods; across a longer one how an input bends is not known


@dataclass(frozen=True, slots=True)
class InterpolatedInput:
    """``value`` (k) at ``time`` (k) s, without the fastest noise, and the second derivative by
    which it ``bends`` (k) there, where that shows.  ``integral``: lines between values at other
    times are to have its integral, otherwise these are its own values.  ``shakes`` (k): the noise
    in what is read, as far as ``WINDOW`` s tell, and ``at_rest`` (k), as far as ``value`` does; 0
    where the input moves, None where it is not sought.

    A pedal let go takes 20 ms: straight lines between samples 10 ms apart, and again between
    events, lose or make a thousandth of a slip's heat there.
    """

    time: Floats
    value: Floats
    bends: Floats
    integral: bool = True
    shakes: Floats | None = None
    at_rest: Floats | None = None

    @classmethod
    def straight(cls, time: Floats, value: Floats) -> InterpolatedInput:
        """Lines between these points."""
        return cls(time, value, np.zeros(len(time)))

    @classmethod
    def of(cls, time: Floats, read: Floats, noise: float) -> InterpolatedInput:
        """Of readings with this ``noise``: parabolas through ``WINDOW`` s, and the readings
        themselves where those are off by more than noise."""
        if seldom(time):
            return cls.straight(time, read)
        period, count = _window(time)
        return cls(time, _parabolas(read, count, noise), _second(time, read, period, noise))

    @classmethod
    def at_samples(cls, time: Floats, read: Floats, noise: float, ar: float) -> InterpolatedInput:
        """The same of what a state follows from sample to sample, its own values in between, of
        readings whose noise has the AR(1) coefficient ``ar``: their adaptive mean, and parabolas
        through ``CLOSE`` samples where those through ``WINDOW`` s are off.  What noise is left in
        them is in derivatives, and in the innovations of what the input settles at once."""
        period, count = _window(time)
        if not CLOSE <= count <= len(time):
            return cls.straight(time, read)
        close, smooth = _parabolas(read, CLOSE, noise), parabolas(read, count)
        off = maximum_filter1d(np.abs(close - smooth), CLOSE) > CALM * noise
        value = np.where(off, close, adaptive_mean(time, read, noise, ar))
        shakes, at_rest = (np.where(off, 0.0, read - each) for each in (smooth, value))
        return cls(time, value, _second(time, read, period, noise), False, shakes, at_rest)

    def at(self, t: Floats, spacing: Floats) -> Floats:
        """Values at ``t`` (K) whose straight connections have the input's integral; ``spacing`` (K)
        s²: the mean square distance to the times before and after."""
        values = np.empty(len(t))
        of = self.time, self.value, self.bends
        _between(t, *map(np.ascontiguousarray, of), spacing, float(self.integral), values)
        return values

    def off(self, t: Floats, spacing: Floats) -> Floats:
        """By how much lines between the samples, and between the times ``t`` (K), are off."""
        if not self.bends.any():
            return np.zeros(len(t))
        after = np.clip(np.searchsorted(self.time, t), 1, len(self.time) - 1)
        width = self.time[after] - self.time[after - 1]
        since = np.clip(t - self.time[after - 1], 0.0, width)
        bends = np.interp(t, self.time, self.bends)
        return bends * (since * (width - since) / 2.0 + self.integral * spacing / 12.0)


@compiled
def _between(
    t: Floats,
    time: Floats,
    value: Floats,
    bends: Floats,
    spacing: Floats,
    integral: float,
    out: Floats,
) -> None:
    """``out`` (K): see :meth:`InterpolatedInput.at`; quick where ``t`` (K) is nearly in order."""
    last, j = len(time) - 1, 0
    for k in range(len(t)):
        if t[k] <= time[0]:
            out[k] = value[0] - bends[0] * integral * spacing[k] / 12.0
        elif t[k] >= time[last]:
            out[k] = value[last] - bends[last] * integral * spacing[k] / 12.0
        else:
            while time[j] > t[k]:
                j -= 1
            while time[j + 1] <= t[k]:
                j += 1
            since, width = t[k] - time[j], time[j + 1] - time[j]
            share = since / width
            bend = bends[j] + share * (bends[j + 1] - bends[j])
            line = value[j] + share * (value[j + 1] - value[j])
            out[k] = line - bend * (since * (width - since) / 2.0 + integral * spacing[k] / 12.0)


@compiled
def slopes_of(t: Floats, at: Floats, time: Floats, value: Floats, j: int, out: Floats) -> None:
    """Column ``j`` of ``out`` (K, nu): slopes on the way to each of the times ``t`` (K), where the
    straight connections of ``value`` (k) at ``time`` (k) are read ``at`` (K)."""
    last, i, before = len(time) - 1, 0, 0.0
    for k in range(len(t)):
        if at[k] <= time[0]:
            now = value[0]
        elif at[k] >= time[last]:
            now = value[last]
        else:
            while time[i] > at[k]:
                i -= 1
            while time[i + 1] <= at[k]:
                i += 1
            share = (at[k] - time[i]) / (time[i + 1] - time[i])
            now = value[i] + share * (value[i + 1] - value[i])
        if k > 0 and t[k] > t[k - 1]:
            out[k, j] = (now - before) / (t[k] - t[k - 1])
        before = now


def seldom(time: Floats) -> bool:
    """Whether samples (k) come too seldom, or are too few, for parabolas through ``WINDOW`` s."""
    return not FIVE <= _window(time)[1] <= len(time)


def _window(time: Floats) -> tuple[float, int]:
    """s from sample to sample (k), and how many ``WINDOW`` s hold, an odd number."""
    period = max(float(np.median(np.diff(time))), 1e-3)
    return period, round(WINDOW / period) // 2 * 2 + 1


def _parabolas(read: Floats, count: int, noise: float) -> Floats:
    """Parabolas through so many samples, and readings (k) themselves where those are off by more
    than noise."""
    smooth = parabolas(read, count)
    return np.where(np.abs(read - smooth) > BENDS * noise, read, smooth)


def _second(time: Floats, read: Floats, period: float, noise: float) -> Floats:
    """Second derivative (k) of readings, of parabolas through five, where it is no noise."""
    second = parabolas(read, FIVE, 2, period)
    scatter = noise * np.sqrt(2.0 / 7.0) / period**2  # of five samples of white noise
    gaps = np.concatenate([[True], np.diff(time) > GAP * period, [True]])
    near = np.convolve(gaps, np.ones(FIVE - 1))[2 : len(time) + 2] > 0
    return np.where((np.abs(second) > TURNS * scatter) & ~near, second, 0.0)


def spacing(t: Floats) -> Floats:
    """Mean square distance (K), s², of times ``t`` (K) to those before and after; zero where one
    of them is far."""
    span = np.diff(t)
    square = np.zeros(len(t))
    around = np.maximum(span[1:] + span[:-1], 1e-9)
    square[1:-1] = (span[1:] ** 3 + span[:-1] ** 3) / around
    return np.where(square < WINDOW**2, square, 0.0)
