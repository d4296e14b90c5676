"""Which gear is engaged, told from engine and wheel speed alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from clutchest.signals import Floats

TOLERANCE = 0.04  # of the ratio; neighbouring gears are at least 20 % apart
WINDOW = 0.3  # s; averages out the driveline's shuffle, ±8 % at several Hz
HOLD = 0.5  # s; an engine that merely passes through a gear's speed is quicker
_ENGINE_RUNS = 30.0  # rad/s
_WHEEL_TURNS = 1.0  # rad/s


def engaged_gear(
    time: Floats, wheel: Floats, engine: Floats, gears: Sequence[float]
) -> NDArray[np.intp] | None:
    """Index into ``gears`` for each sample, shape (n,); None if no gear is ever locked.

    ``wheel`` and ``engine`` rad/s at ``time`` s; NaN where unknown.  Where engine over wheel, both
    averaged over ``WINDOW``, stays within ``TOLERANCE`` of one ratio for ``HOLD``, the clutch is
    locked in that gear.  Everything before a locked piece, back to the end of the previous one,
    has the gear of the piece to come, so that a launch slips in the gear in which it ends; behind
    the last piece its gear stays.
    """
    if not len(time):
        return None
    ratio = np.asarray(gears, np.float64)
    known = np.isfinite(wheel) & np.isfinite(engine)
    first = np.searchsorted(time, time - WINDOW / 2)
    behind = np.searchsorted(time, time + WINDOW / 2, side="right")

    def summed(values: NDArray) -> Floats:
        total = np.concatenate(([0.0], np.cumsum(np.where(known, values, 0.0))))
        return total[behind] - total[first]

    count = np.maximum(summed(np.ones(len(time))), 1.0)
    wheel, engine = summed(wheel) / count, summed(engine) / count
    turning = (wheel > _WHEEL_TURNS) & (engine > _ENGINE_RUNS)
    quotient = np.divide(engine, wheel, out=np.full(len(time), np.inf), where=turning)
    deviation = np.abs(quotient[:, None] / ratio - 1)
    gear = np.argmin(deviation, axis=1)
    fits = turning & (deviation[np.arange(len(time)), gear] < TOLERANCE)
    label = np.where(fits, gear, -1)

    starts = np.concatenate(([0], np.flatnonzero(np.diff(label)) + 1))
    ends = np.concatenate((starts[1:], [len(label)])) - 1
    locked = np.flatnonzero((label[starts] >= 0) & (time[ends] - time[starts] >= HOLD))
    if not len(locked):
        return None
    # For each run the next locked run, itself included; the last one for all that follow.
    following = np.minimum(np.searchsorted(locked, np.arange(len(starts))), len(locked) - 1)
    return np.repeat(label[starts[locked[following]]], ends - starts + 1)
