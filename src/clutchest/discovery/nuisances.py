"""What is free beside the curves that are tested."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from clutchest.inference.white_linearisation import Linearisation
from clutchest.signals import Floats


@dataclass(frozen=True, slots=True)
class Nuisances:
    """What is free beside curves at a linearisation ``at``: ``free`` unknowns (indices), of
    precision ``prior`` (m)."""

    at: Linearisation
    free: NDArray[np.int64]
    prior: Floats

    def also(self, columns: Floats, std: float) -> Nuisances:
        """With unknowns whose derivatives are ``columns`` (K, c), expected at 0 with a standard
        deviation ``std``."""
        count, more = len(self.prior), columns.shape[1]
        free = np.append(self.free, np.arange(count, count + more))
        at = replace(
            self.at,
            theta=np.append(self.at.theta, np.zeros(more)),
            by_active=np.column_stack([self.at.by(self.free), columns]),
            active=free,
        )
        return Nuisances(at, free, np.append(self.prior, np.full(more, std**-2.0)))

    def explained(self) -> Nuisances:
        """With the innovations that are left where they explain what they can."""
        psi = self.at.by(self.free)
        inner = psi.T @ psi + np.diag(self.prior[self.free] + 1e-9)
        step = np.linalg.solve(
            inner, psi.T @ self.at.r + self.prior[self.free] * self.at.theta[self.free]
        )
        theta = self.at.theta.copy()
        theta[self.free] -= step
        return replace(self, at=replace(self.at, theta=theta, r=self.at.r - psi @ step))
