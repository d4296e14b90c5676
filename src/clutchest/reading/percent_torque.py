"""What percentages stand for; of a J1939 torque actual + fraction − nominal friction."""

from __future__ import annotations

import numpy as np

from clutchest import memory_mapped, units
from clutchest.reading.samples import VALID, Samples
from clutchest.signals import Floats
from clutchest.vehicle import SignalMap


def of_reference(
    signal: SignalMap, actual: Samples, fraction: Samples | None, friction: Samples | None
) -> Floats:
    """The signal, in the unit of its reference, at each of the ``actual`` samples (n).

    An invalid ``fraction`` counts as 0, since not every engine sends one; without a valid
    ``friction`` none is subtracted.  None where the vehicle file maps no such signal.
    """
    shares: list[tuple[int, Floats, str]] = []
    if fraction is not None and signal.fraction and len(fraction.rows):
        share = np.where(fraction.why == VALID, fraction.value, 0.0)
        known = Samples(fraction.rows, share, np.zeros_like(fraction.why))
        shares.append((1, known.at(actual.rows), signal.fraction.unit))
    if friction is not None and signal.friction and friction.any_valid():
        shares.append((-1, friction.at(actual.rows), signal.friction.unit))
    value = memory_mapped.empty((len(actual.rows),), np.float64)
    for part in memory_mapped.portions(len(actual.rows)):
        percent = units.convert(actual.value[part], signal.bus.unit, "%")
        for sign, share, unit in shares:
            percent = percent + sign * units.convert(share[part], unit, "%")
        value[part] = percent * (signal.reference or 0.0) / 100
        memory_mapped.release_memory()
    return value
