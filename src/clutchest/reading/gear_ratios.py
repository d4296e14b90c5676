"""Gear ratios and thresholds of lock-up, learned from the speeds of engine and wheels alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from clutchest.models.regimes import average, lasting, runs
from clutchest.reading.gears import ENGINE_RUNS, HOLD, TOLERANCE, WHEEL_TURNS, WINDOW
from clutchest.signals import Floats

LEAST_S = 0.8  # in a gear, in all, by which its ratio is known
APART = 0.12  # of a ratio; gears are at least so far apart
PEAK = 1.5  # times the time beside a ratio, that at it; an even drift has 1
FINE = 0.005  # of a ratio, width of the classes in which time is counted
FOLLOWS = 0.05  # of its mean, by which wheels that count as changing change
IDLES = 1.15  # times the slowest engine, up to which it may be one that idles
MEDIAN = 1.2533  # standard error of a median over that of a mean, √(π/2)
ALONE = 0.02  # of a ratio, its standard deviation where it was held once only
QUIET, SHAKEN = 2.0, 0.3  # rad/s of slip, and s of the mean, where the driveline shakes the speeds
SHARE = 0.995  # of the samples in a locked gear, whose slip counts as locked


@dataclass(frozen=True, slots=True)
class GearRatio:
    """``ratio`` engine/wheel ± ``std``, held for ``seconds``."""

    ratio: float
    std: float
    seconds: float


@dataclass(frozen=True)
class Learned:
    """Gears, first gear first, ``gear`` (n) which of them each sample is in, −1 in none;
    ``scatter`` of the ratio in them, relative; ``lock_slip`` rad/s of the mean over
    ``lock_average`` s that is not exceeded while locked."""

    gears: tuple[GearRatio, ...]
    gear: NDArray[np.intp]
    scatter: float
    lock_slip: float
    lock_average: float

    @property
    def seconds(self) -> float:
        """s in any gear."""
        return sum(gear.seconds for gear in self.gears)


def learn_gears(time: Floats, wheel: Floats, engine: Floats) -> Learned:
    """The ratios at which engine and wheels turn together for long.

    ``wheel`` and ``engine`` rad/s at ``time`` s, sorted, (n) each.  In a gear their quotient stays
    where it is while they change; an open clutch lets it drift.
    """
    calm_wheel, calm_engine = average(time, wheel, WINDOW), average(time, engine, WINDOW)
    turning = (calm_wheel > WHEEL_TURNS) & (calm_engine > ENGINE_RUNS)
    quotient = np.divide(calm_engine, calm_wheel, out=np.full(len(time), np.nan), where=turning)
    step = np.minimum(np.gradient(time), HOLD) if len(time) > 1 else np.zeros(len(time))
    left, found = turning.copy(), []
    idle = float(np.percentile(calm_engine[calm_engine > ENGINE_RUNS], 2)) if turning.any() else 0.0
    while True:
        ratio = _most_held(quotient[left], step[left])
        if ratio is None:
            break
        near = turning & (np.abs(quotient / ratio - 1) < TOLERANCE)
        held = lasting(time, near, HOLD)
        left &= np.abs(quotient / ratio - 1) > APART
        if step[held].sum() < LEAST_S or not _peaked(quotient / ratio - 1, step):
            continue
        if _one_follows_the_other(calm_wheel[held], calm_engine[held], idle):
            found.append((held, _ratio(time, quotient, held, step)))
    found.sort(key=lambda each: -each[1].ratio)
    return _learned(time, wheel, engine, found)


def same_speed(time: Floats, shaft: Floats, engine: Floats) -> Learned:
    """The same of a ``shaft`` (n) rad/s behind the clutch itself, whose only ratio is 1."""
    calm_shaft, calm_engine = average(time, shaft, WINDOW), average(time, engine, WINDOW)
    turning = (calm_shaft > WHEEL_TURNS) & (calm_engine > ENGINE_RUNS)
    near = turning & (np.abs(calm_engine - calm_shaft) < TOLERANCE * calm_engine)
    held = lasting(time, near, HOLD)
    step = np.minimum(np.gradient(time), HOLD) if len(time) > 1 else np.zeros(len(time))
    if step[held].sum() < LEAST_S:
        return _learned(time, shaft, engine, [])
    return _learned(time, shaft, engine, [(held, GearRatio(1.0, 0.0, float(step[held].sum())))])


def _most_held(quotient: Floats, step: Floats) -> float | None:
    """The ratio around which most time was spent, if that is enough for a gear."""
    if not len(quotient):
        return None
    place, width = np.log(quotient) / FINE, round(TOLERANCE / FINE)
    first = int(np.floor(place.min())) - width
    classes = (np.floor(place) - first).astype(np.intp)
    spent = np.bincount(classes, weights=step, minlength=int(classes.max()) + width + 1)
    around = np.convolve(spent, np.ones(2 * width + 1), mode="same")
    best = int(np.argmax(around))
    if around[best] < LEAST_S:
        return None
    here = np.abs(classes - best) <= width
    return float(np.median(quotient[here]))


def _peaked(off: Floats, step: Floats) -> bool:
    """Whether more time is spent at a ratio than on either side of it; ``off`` (n) relative, NaN
    elsewhere."""
    above = step[(off >= TOLERANCE) & (off < 2.0 * TOLERANCE)].sum()
    below = step[(off <= -TOLERANCE) & (off > -2.0 * TOLERANCE)].sum()
    return bool(step[np.abs(off) < TOLERANCE].sum() > PEAK * 2.0 * max(above, below))


def _one_follows_the_other(wheel: Floats, engine: Floats, idle: float) -> bool:
    """Whether both speeds change together; an engine that idles beside wheels of one speed is no
    gear."""
    of_wheel, of_engine = (
        float(np.ptp(np.percentile(speed, [2, 98])) / np.mean(speed)) for speed in (wheel, engine)
    )
    if of_wheel > FOLLOWS:
        return of_engine > of_wheel / 2
    return bool(np.median(engine) > IDLES * idle)


def _ratio(time: Floats, quotient: Floats, held: NDArray[np.bool_], step: Floats) -> GearRatio:
    """Median of the quotient, and its standard error from means over half a second."""
    value = float(np.median(quotient[held]))
    piece = np.floor(time[held] / HOLD).astype(np.int64)
    _, of = np.unique(piece, return_inverse=True)
    means = np.bincount(of, weights=quotient[held]) / np.bincount(of)
    spread = MEDIAN * float(np.std(means, ddof=1)) if len(means) > 2 else 0.0
    std = spread / sqrt(len(means)) if spread else ALONE * value
    return GearRatio(value, std, float(step[held].sum()))


def _learned(
    time: Floats,
    wheel: Floats,
    engine: Floats,
    found: Sequence[tuple[NDArray[np.bool_], GearRatio]],
) -> Learned:
    """With the slip in all gears, and the thresholds that it calls for."""
    slip, ratio = np.full(len(time), np.nan), np.full(len(time), np.nan)
    of = np.full(len(time), -1, np.intp)
    for number, (near, gear) in enumerate(found):
        held = near & (wheel > 0.0)  # single readings of a dropped one may be 0
        of[held] = number
        slip[held] = engine[held] - wheel[held] * gear.ratio
        ratio[held] = engine[held] / (wheel[held] * gear.ratio)
    locked = of >= 0
    if not locked.any():
        return Learned((), of, np.inf, QUIET, 0.0)
    inside = _inside(time, locked)
    single = _highest(np.abs(slip[inside]))
    shaken = single > QUIET
    least = single
    if shaken:
        mean = average(time, np.where(locked, slip, 0.0), SHAKEN)
        least = _highest(np.abs(mean[inside]))
    threshold = max(QUIET, float(np.ceil(2.0 * least) / 2.0))
    return Learned(
        tuple(gear for _, gear in found),
        of,
        float(np.std(ratio[locked])),
        threshold,
        SHAKEN if shaken else 0.0,
    )


def _inside(time: Floats, locked: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The samples away from the ends of each stretch, where the clutch may slip still."""
    inside = locked.copy()
    for a, b in zip(*runs(locked), strict=True):
        near = (time[a:b] < time[a] + HOLD) | (time[a:b] > time[b - 1] - HOLD)
        if not near.all():
            inside[a:b] &= ~near
    return inside


def _highest(slip: Floats) -> float:
    return float(np.quantile(slip, SHARE))
