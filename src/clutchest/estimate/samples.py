"""Samples of one signal: slopes, noise, gaps, averages."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import inf

import numpy as np
from numpy.typing import NDArray

from clutchest.estimate.sample_timing import SampleTiming
from clutchest.native import compiled
from clutchest.signals import Floats, Signal

SLOPE_WINDOW = 0.1  # s, over which the slope of the engine speed is fitted
APART = 4.0  # periods; samples further apart do not belong together


def blind(time: Floats, signal: Signal, gap: float) -> NDArray[np.bool_]:
    """Where the nearest samples on both sides lie further apart than ``gap`` s; ``time`` sorted."""
    return np.asarray(_blind(time, signal.time, gap))


@compiled
def _blind(time, samples, gap):  # type: ignore[no-untyped-def]
    missing = np.zeros(len(time), np.bool_)
    missing[: np.searchsorted(time, samples[0] - gap)] = True
    missing[np.searchsorted(time, samples[-1] + gap, side="right") :] = True
    for k in range(1, len(samples)):
        if samples[k] - samples[k - 1] > gap:
            first = np.searchsorted(time, samples[k - 1], side="right")
            missing[first : np.searchsorted(time, samples[k], side="right")] = True
    return missing


@compiled
def places(values, some):  # type: ignore[no-untyped-def]
    """As ``np.searchsorted(values, some)``, of ``some`` (n,) that ascend too: values are passed
    once."""
    place, k = np.empty(len(some), np.int64), 0
    for i in range(len(some)):
        while k < len(values) and values[k] < some[i]:
            k += 1
        place[i] = k
    return place


def white_density(noise: float, ar: float, period: float) -> float:
    """Noise variance per s of a sampled input that is integrated over: σ² Ts (1 + ρ)/(1 − ρ)."""
    return noise**2 * period * (1 + ar) / (1 - ar)


def slope_count(period: float, window: float = SLOPE_WINDOW) -> int:
    """How many samples a slope over ``window`` s is fitted to: odd, the middle one has it."""
    return int(np.clip(round(window / max(period, 1e-6)) | 1, 3, 101))


def slope(
    signal: Signal,
    noise: float,
    window: float = SLOPE_WINDOW,
    *,
    timing: SampleTiming | None = None,
    gap: float = inf,
) -> tuple[Signal, float]:
    """Slope of a signal by straight lines through ``window`` s, and its standard deviation.

    Outside the reach of a full window the nearest full one stands; no line goes through a hole of
    more than ``gap`` s.  ``timing`` is the signal's own unless given.
    """
    time, value = signal.time, signal.value
    period = (timing or SampleTiming.of(signal)).period
    count = slope_count(period, window)
    slopes = np.zeros(len(time))
    edges = [0, *(np.flatnonzero(time[1:] - time[:-1] > gap) + 1).tolist(), len(time)]
    for a, b in pairwise(edges):
        if b - a >= count:
            slopes[a:b] = _lines(time[a:b], value[a:b], count)
    rate = Signal.of("slope", "", time, slopes)
    if len(time) < count:
        return rate, 0.0
    moment = period**2 * count * (count**2 - 1) / 12  # Σ (t − mean)² of samples evenly spaced
    return rate, float(noise / np.sqrt(max(moment, 1e-12)))


@compiled
def _lines(time, value, count):  # type: ignore[no-untyped-def]
    """The slope at every sample of a straight line through the ``count`` samples around it."""
    half, n = count // 2, len(time)
    slopes = np.empty(n)
    for k in range(half, n - half):
        mean = 0.0
        for j in range(k - half, k + half + 1):
            mean += time[j]
        mean /= count
        moment = product = 0.0
        for j in range(k - half, k + half + 1):
            moment += (time[j] - mean) ** 2
            product += (time[j] - mean) * value[j]
        slopes[k] = product / max(moment, 1e-12)
    slopes[:half] = slopes[half]
    slopes[n - half :] = slopes[n - half - 1]
    return slopes


@dataclass(frozen=True, slots=True)
class SensorReadings:
    """SensorReadings: at ``time`` a ``value`` of variance ``variance``, from samples between
    ``first`` and ``last``, as many as there may be where it is ``full``; (n,) each."""

    time: Floats
    value: Floats
    variance: Floats
    first: Floats
    last: Floats
    full: NDArray[np.bool_]


def readings_of(
    signal: Signal, noise: float, ar: float, repeats: float, timing: SampleTiming | None = None
) -> SensorReadings:
    """SensorReadings with errors that are white.

    Coloured noise repeats itself: its readings count for less.  Those that a sensor ``repeats``
    are averaged, and their average is no better than one of them.
    """
    time = signal.time
    if not len(time):
        return SensorReadings(time, time, time, time, time, np.zeros(0, bool))
    period = max((timing or SampleTiming.of(signal)).period, 1e-3)
    coloured = (1 + ar) / (1 - ar)
    most = round(2.0 * repeats / period) | 1  # odd: the middle one is where the average holds
    if most == 1:
        variance = np.full(len(time), noise**2 * coloured)
        return SensorReadings(time, signal.value, variance, time, time, np.ones(len(time), bool))
    first, count, value = _averages(time, signal.value, APART * period, most)
    variance = noise**2 * np.maximum(coloured, most) / count
    return SensorReadings(
        time[first + count // 2],
        value,
        variance,
        time[first],
        time[first + count - 1],
        count == most,
    )


@compiled
def _averages(time, value, apart, most):  # type: ignore[no-untyped-def]
    """First sample, number of samples and mean of every ``most`` that follow each other without a
    hole of more than ``apart`` s."""
    first, count = np.empty(len(time), np.int64), np.zeros(len(time), np.int64)
    mean, n = np.zeros(len(time)), -1
    for k in range(len(time)):
        if n < 0 or count[n] == most or time[k] - time[k - 1] > apart:
            n += 1
            first[n] = k
        count[n] += 1
        mean[n] += value[k]
    for k in range(n + 1):
        mean[k] /= count[k]
    return first[: n + 1], count[: n + 1], mean[: n + 1]
