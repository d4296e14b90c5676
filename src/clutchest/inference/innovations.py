"""Innovations of one drive at some numbers, in standard deviations, and their derivatives."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from clutchest.inference.operating_point import OperatingPoint
from clutchest.signals import Floats

NO_DERIVATIVES = np.zeros(0, np.int64)


@dataclass(frozen=True, slots=True)
class NormalisedInnovations:
    """Of the readings (K) of one drive, sensor after sensor, each in order of time.

    ``table`` (K, 1 + a): ``r`` (K) innovations over their predicted standard deviation, and their
    derivatives by the ``active`` (a) ones of ``count`` thetas, all unless given, each in its unit:
    read-only where it is kept for others.  ``implied``: the operating point of the drive there.
    """

    table: Floats
    count: int
    implied: OperatingPoint
    active: NDArray[np.int64] | None = None

    @property
    def r(self) -> Floats:
        """Shape (K,)."""
        return self.table[:, 0]

    @property
    def psi(self) -> Floats:
        """Derivatives by every θ, shape (K, count): 0 by those that are not active."""
        if self.active is None:
            return self.table[:, 1:]
        every = np.zeros((len(self.table), self.count))
        every[:, self.active] = self.table[:, 1:]
        return every

    @property
    def alone(self) -> NormalisedInnovations:
        """The same without derivatives."""
        return self.only(NO_DERIVATIVES)

    def only(self, active: NDArray[np.int64]) -> NormalisedInnovations:
        """The same with derivatives by these of the ``active`` thetas, in memory that nobody
        changes: its own where this one's may be."""
        known = np.arange(self.count) if self.active is None else self.active
        if len(active) == len(known):
            changes = self.table.flags.writeable
            return replace(self, table=self.table.copy()) if changes else self
        columns = np.append(0, 1 + np.searchsorted(known, active))
        return replace(self, table=self.table[:, columns], active=active)

    def change(self, step: Floats) -> Floats:
        """ψ · ``step`` (count): by how much the innovations (K) change, to first order."""
        return self.table[:, 1:] @ (step if self.active is None else step[self.active])
