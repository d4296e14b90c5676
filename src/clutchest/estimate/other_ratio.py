"""Whether two shafts that a clutch couples are read as if a gear were between them."""

from __future__ import annotations

import numpy as np

from clutchest.estimate.contradiction import Contradiction
from clutchest.reading.gear_ratios import learn_gears
from clutchest.signals import Floats, Signals
from clutchest.vehicle import Vehicle

LONG_S = 5.0  # at one ratio, which no slip stays at while both speeds change
APART = 0.01  # of a speed, by which teeth or a ratio are wrong
STEADY = 0.01  # of the ratio, within which nine tenths of it lie in a locked clutch
CHANGES = 0.2  # of its mean, by which a speed changes, so that a test at two steady speeds is none


def at_another_ratio(drive: Signals, vehicle: Vehicle) -> Contradiction | None:
    """That a drive turns both sides of the clutch at one ratio for long, which is not 1: a wrong
    number of teeth or gear ratio, with which a locked clutch counts as one that slips for ever."""
    for column in vehicle.machine.columns:
        engine, shaft = column.geared_by, column.name
        if not engine or not {engine, shaft} <= set(drive.available):
            continue
        read = drive[engine].only_valid()
        behind = drive[shaft].only_valid().at(read.time)
        held, ratio, seconds = _longest(read.time, behind, read.value)
        if seconds < LONG_S or abs(ratio - 1.0) < APART:
            continue
        low, high = np.percentile(read.value[held] / behind[held], (5.0, 95.0))
        slowest, fastest = np.percentile(behind[held], (2.0, 98.0))
        if high - low > STEADY * ratio or fastest - slowest < CHANGES * np.mean(behind[held]):
            continue
        return Contradiction(
            f"{engine} is {ratio:.4g} times {shaft} for {seconds:.0f} s while both change, "
            "expected the same speed, as of a locked clutch",
            shaft,
            float(read.time[held][0]),
            f"a wrong number of teeth or gear ratio: {ratio:.4g} times {shaft} would fit",
            "ratio",
            (engine,),
        )
    return None


def _longest(time: Floats, shaft: Floats, engine: Floats) -> tuple[np.ndarray, float, float]:
    """Of the ratio that is held longest: which samples (n), engine over shaft, and s."""
    learned = learn_gears(time, shaft, engine)
    if not learned.gears:
        return np.zeros(len(time), bool), 1.0, 0.0
    k = max(range(len(learned.gears)), key=lambda k: learned.gears[k].seconds)
    return learned.gear == k, learned.gears[k].ratio, learned.gears[k].seconds
