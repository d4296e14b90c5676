"""The samples of one bus signal, frame by frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clutchest import memory_mapped
from clutchest.signals import Floats, Why

VALID = np.uint8(Why.VALID)


@dataclass(frozen=True, slots=True)
class Samples:
    """Samples of one bus signal: row in the log, value in the bus unit, and why not; (n,) each."""

    rows: NDArray[np.intp]
    value: Floats
    why: NDArray[np.uint8]

    def at(self, rows: NDArray[np.intp]) -> Floats:
        """The last valid value at each of ``rows``; before the first one, the first."""
        valid = self.why == VALID
        known, value = self.rows, self.value
        if not valid.all():
            known, value = (
                memory_mapped.mapped_to_disk(known[valid]),
                memory_mapped.mapped_to_disk(value[valid]),
            )
        held = memory_mapped.empty((len(rows),), np.float64)
        for part in memory_mapped.portions(len(rows)):
            latest = np.searchsorted(known, rows[part], side="right") - 1
            held[part] = value[np.maximum(latest, 0)]
        return held

    def any_valid(self) -> bool:
        """Whether any sample is valid."""
        return bool(np.any(self.why == VALID))


NONE = Samples(np.zeros(0, np.intp), np.zeros(0), np.zeros(0, np.uint8))
