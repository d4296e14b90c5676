"""One estimate of a drive with its name, unit and times: what ``run["temp_disc"]`` gives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clutchest.shown import Comparable, Shown, plus_minus
from clutchest.signals import Floats


@dataclass(frozen=True, slots=True, eq=False)
class EstimatedSeries(Comparable):
    """``value`` ± ``std`` in ``unit`` at ``time`` s of the drive, and where they are ``valid``;
    shape (m,) each."""

    name: str
    unit: str
    time: Floats
    value: Floats
    std: Floats
    valid: NDArray[np.bool_]

    def only_valid(self) -> EstimatedSeries:
        """Without what is not valid."""
        time, value, std = (column[self.valid] for column in (self.time, self.value, self.std))
        return EstimatedSeries(self.name, self.unit, time, value, std, self.valid[self.valid])

    def shown(self) -> Shown:
        """How many there are, and the last one."""
        line = f"{self.name}, {len(self)} values, {np.count_nonzero(self.valid)} of them valid"
        if len(self):
            last = plus_minus(float(self.value[-1]), float(self.std[-1]), self.unit)
            line += f", at {self.time[-1]:.1f} s {last}"
        return Shown(line)

    def __repr__(self) -> str:
        return f"<EstimatedSeries: {self.shown().line}>"

    def __len__(self) -> int:
        return len(self.time)
