"""What plots and tables call a quantity, and the unit in which people read it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clutchest.units import convert

# SI is right inside; on a plot people expect what the dashboard and the data sheet say.
_READ_IN = {"m": "mm", "rad/s": "rpm", "m/s": "km/h", "J": "kJ", "W": "kW", "1": ""}


@dataclass(frozen=True, slots=True)
class Quantity:
    """``name`` as in the Parquet file, ``unit`` of the data, ``what`` it is in a few words."""

    name: str
    unit: str
    what: str = ""

    @property
    def shown(self) -> str:
        """The unit people read; empty for a pure number."""
        return _READ_IN.get(self.unit, self.unit)

    @property
    def words(self) -> str:
        """The name as words, without the unit: ``disc temperature``."""
        words = self.name.split("_")
        if words[0] == "temp":
            return " ".join([*words[1:], "temperature"])
        if words[-1] == "temp":
            return " ".join([*words[:-1], "temperature"])
        return " ".join(words)

    @property
    def label(self) -> str:
        """Name and unit, for an axis or a heading."""
        return f"{self.words} [{self.shown}]" if self.shown else self.words

    def read(self, values: NDArray) -> NDArray[np.float64]:
        """``values`` in the shown unit, shape kept."""
        values = np.asarray(values, np.float64)
        return convert(values, self.unit, self.shown or "1")

    def read_spread(self, std: NDArray) -> NDArray[np.float64]:
        """A standard deviation in the shown unit: the scale without the offset."""
        return self.read(std) - self.read(np.zeros(1))[0]
