"""What the samples of one signal tell: slopes, noise, holes, averages."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import inf

import numpy as np
from numpy.typing import NDArray

from clutchest.estimate.habits import Habit
from clutchest.signals import Floats, Signal

SLOPE_WINDOW = 0.1  # s, over which the slope of the engine speed is fitted
APART = 4.0  # periods; samples further apart do not belong together


def blind(time: Floats, signal: Signal, gap: float) -> NDArray[np.bool_]:
    """Where the nearest samples on both sides lie further apart than ``gap`` s; ``time`` sorted."""
    outside = (time < signal.time[0] - gap) | (time > signal.time[-1] + gap)
    last = np.flatnonzero(signal.time[1:] - signal.time[:-1] > gap)  # samples before a hole
    if not len(last):
        return outside
    holes = np.zeros(len(time) + 1, np.int64)
    np.add.at(holes, np.searchsorted(time, signal.time[last], "right"), 1)
    np.add.at(holes, np.searchsorted(time, signal.time[last + 1], "right"), -1)
    return (np.cumsum(holes[:-1]) > 0) | outside


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
    habit: Habit | None = None,
    gap: float = inf,
) -> tuple[Signal, float]:
    """Slope of a signal by straight lines through ``window`` s, and its standard deviation.

    Outside the reach of a full window the nearest full one stands; no line goes through a hole of
    more than ``gap`` s.  ``habit`` is the signal's own unless given.
    """
    time, value = signal.time, signal.value
    period = (habit or Habit.of(signal)).period
    count = slope_count(period, window)
    slopes = np.zeros(len(time))
    edges = [0, *(np.flatnonzero(time[1:] - time[:-1] > gap) + 1).tolist(), len(time)]
    for a, b in pairwise(edges):
        if b - a >= count:
            slopes[a:b] = _lines(time[a:b], value[a:b], count)
    found = Signal.of("slope", "", time, slopes)
    if len(time) < count:
        return found, 0.0
    moment = period**2 * count * (count**2 - 1) / 12  # Σ (t − mean)² of samples evenly spaced
    return found, float(noise / np.sqrt(max(moment, 1e-12)))


def _lines(time: Floats, value: Floats, count: int) -> Floats:
    """The slope at every sample of a straight line through the ``count`` samples around it."""
    t = np.lib.stride_tricks.sliding_window_view(time, count)
    y = np.lib.stride_tricks.sliding_window_view(value, count)
    centred = t - t.mean(axis=1, keepdims=True)
    moment = np.maximum((centred**2).sum(axis=1), 1e-12)
    return np.pad((centred * y).sum(axis=1) / moment, count // 2, mode="edge")


@dataclass(frozen=True, slots=True)
class Told:
    """What readings tell: at ``time`` a ``value`` of variance ``variance``, from samples between
    ``first`` and ``last``, as many as there may be where it is ``full``; (n,) each."""

    time: Floats
    value: Floats
    variance: Floats
    first: Floats
    last: Floats
    full: NDArray[np.bool_]


def told(
    signal: Signal, noise: float, ar: float, repeats: float, habit: Habit | None = None
) -> Told:
    """Readings with errors that are white.

    Coloured noise repeats itself: its readings count for less.  Those that a sensor ``repeats``
    are averaged, and their average is no better than one of them.
    """
    time = signal.time
    if not len(time):
        return Told(time, time, time, time, time, np.zeros(0, bool))
    period = max((habit or Habit.of(signal)).period, 1e-3)
    coloured = (1 + ar) / (1 - ar)
    most = round(2.0 * repeats / period) | 1  # odd: the middle one is where the average holds
    if most == 1:
        variance = np.full(len(time), noise**2 * coloured)
        return Told(time, signal.value, variance, time, time, np.ones(len(time), bool))
    starts = np.flatnonzero(np.append(True, np.diff(time) > APART * period))
    place = np.arange(len(time)) - np.repeat(starts, np.diff(np.append(starts, len(time))))
    first = np.flatnonzero(place % most == 0)
    count = np.diff(np.append(first, len(time)))
    value = np.add.reduceat(signal.value, first) / count
    variance = noise**2 * np.maximum(coloured, most) / count
    return Told(
        time[first + count // 2], value, variance, time[first], time[first + count - 1],
        count == most,
    )  # fmt: skip
