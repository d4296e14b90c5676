"""Which gear is engaged, inferred from engine and wheel speed alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from clutchest.signals import Floats, Signal, Why
from clutchest.vehicle import SignalMap

TOLERANCE = 0.04  # of the ratio; neighbouring gears are at least 20 % apart
WINDOW = 0.3  # s; averages out the driveline's shuffle, ±8 % at several Hz
HOLD = 0.5  # s; an engine that passes through a gear's speed is quicker
AHEAD = 3.0  # s, by which a gear counts before it is locked: a launch slips in the gear it ends in
SETTLED = AHEAD + HOLD + WINDOW / 2  # s; later samples do not change a gear
ENGINE_RUNS = 30.0  # rad/s
WHEEL_TURNS = 1.0  # rad/s
_MOST_NAMED = 8  # gears


@dataclass(frozen=True, slots=True)
class Engaged:
    """Index into the gears for each sample (n,): ``gear``, and ``held``, from past samples only;
    ``ever_locked``: whether the clutch was locked in any gear at any time."""

    gear: NDArray[np.intp]
    held: NDArray[np.intp]
    ever_locked: bool


def engaged_gear(
    time: Floats, wheel: Floats, engine: Floats, gears: Sequence[float], before: int = 0
) -> Engaged:
    """Which gear is engaged.

    ``wheel`` and ``engine`` rad/s at ``time`` s; NaN where unknown.  Where engine over wheel, both
    averaged over ``WINDOW``, stays within ``TOLERANCE`` of one ratio for ``HOLD``, the clutch is
    locked in that gear.  That gear counts from ``AHEAD`` before, so that a launch slips in the gear
    in which it ends, and until another one counts or the wheels stand; the next launch is in first
    gear.  ``before`` is the gear held at the beginning.
    """
    n = len(time)
    nothing = np.zeros(n, np.intp)
    if not n:
        return Engaged(nothing, nothing, False)
    ratio = np.asarray(gears, np.float64)
    known = np.isfinite(wheel) & np.isfinite(engine)
    first = np.searchsorted(time, time - WINDOW / 2)
    behind = np.searchsorted(time, time + WINDOW / 2, side="right")

    def summed(values: NDArray) -> Floats:
        total = np.concatenate(([0.0], np.cumsum(np.where(known, values, 0.0))))
        return total[behind] - total[first]

    count = np.maximum(summed(np.ones(n)), 1.0)
    wheel, engine = summed(wheel) / count, summed(engine) / count
    turning = (wheel > WHEEL_TURNS) & (engine > ENGINE_RUNS)
    quotient = np.divide(engine, wheel, out=np.full(n, np.inf), where=turning)
    deviation = np.abs(quotient[:, None] / ratio - 1)
    closest = np.argmin(deviation, axis=1)
    fits = turning & (deviation[np.arange(n), closest] < TOLERANCE)
    label = np.where(fits, closest, -1)

    starts = np.concatenate(([0], np.flatnonzero(np.diff(label)) + 1))
    ends = np.concatenate((starts[1:], [n])) - 1
    lasting = (label[starts] >= 0) & (time[ends] - time[starts] >= HOLD)
    locked = np.repeat(np.where(lasting, label[starts], -1), ends - starts + 1)

    rows = np.arange(n)
    last = np.maximum.accumulate(np.where(locked >= 0, rows, -1))
    stood = np.maximum.accumulate(np.where(wheel <= WHEEL_TURNS, rows, -1))
    held = np.where(last >= 0, locked[last], before)
    held = np.where(stood > last, 0, held)
    next_start = np.append(starts[lasting], n)[np.searchsorted(starts[lasting], rows)]
    row = np.minimum(next_start, n - 1)
    counts = (next_start < n) & (time[row] - time <= AHEAD) & (locked < 0)
    return Engaged(np.where(counts, locked[row], held), held, bool(lasting.any()))


def through_sent_gear(
    wheel: Floats,
    why: NDArray[np.uint8],
    gear: Floats,
    ratios: Sequence[float],
    numbers: Sequence[int] = (),
) -> tuple[Floats, NDArray[np.uint8]]:
    """Wheel speed (n) times the ratio of the ``gear`` (n) that the bus sends, and ``why`` (n) not:
    in neutral, reverse and a gear without a ratio there is none.

    ``numbers`` that the bus sends in the gears of ``ratios``, rising; 1, 2, … unless given.
    """
    sent = np.array(numbers or range(1, len(ratios) + 1), np.float64)
    index = np.minimum(np.searchsorted(sent, gear), len(sent) - 1)
    inside = sent[index] == gear
    return wheel * np.array(ratios)[index], np.where(inside, why, np.uint8(Why.NOT_AVAILABLE))


def never_sent(gear: Floats, how: SignalMap) -> list[str]:
    """A warning where the ``gear`` (n) that the bus sends is none of those with a ratio."""
    assert how.gear is not None
    expected = how.gear_numbers or range(1, len(how.gears) + 1)
    if np.isin(gear, expected).any():
        return []
    sent, known = (
        ", ".join(f"{k:g}" for k in each)
        for each in (np.unique(gear[np.isfinite(gear)])[:_MOST_NAMED], expected)
    )
    where = f"{how.name}: {how.gear.message}.{how.gear.signal}"
    return [f"{where} has {sent or 'no number'}, never one of the gears {known}"]


def through_gear(
    wheel: Signal, engine: Signal | None, gears: Sequence[float]
) -> tuple[Signal, Signal | None]:
    """Wheel speed times the ratio of the engaged gear, and that gear, first gear 1; None where no
    gear was ever locked, which makes it the first one.
    """
    known = None if engine is None else engine.only_valid()
    if known is None or not len(known):
        return replace(wheel, value=wheel.value * gears[0]), None
    engaged = engaged_gear(wheel.time, wheel.value, known.at(wheel.time), gears)
    speed = wheel.value * np.array(gears)[engaged.gear]
    shaft = replace(wheel, value=speed)
    if not engaged.ever_locked:
        return shaft, None
    return shaft, gear_signal(wheel.time, engaged.gear.astype(np.float64) + 1.0)


def gear_signal(time: Floats, gear: Floats) -> Signal:
    """The engaged gear (n) at ``time`` (n) s."""
    return Signal.of("gear", "1", time, gear)
