"""How late one signal is behind others that an equation ties it to.

Over stretches of a drive the late signal y obeys y(t) = x_0(t − τ) + Σ c_i x_i(t − τ), with
coefficients c_i that each stretch has for itself.  All columns are smoothed alike (which commutes
with the equation), the coefficients are eliminated, and τ minimises what is left.  Its standard
deviation is clustered by stretch: whatever the noise is like within one, stretches are taken to
be independent.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from clutchest.models.delay_relations import DelayStretch
from clutchest.signals import Floats

EARLIEST, LATEST = -0.15, 0.45  # s, searched
COARSE, DIFFERENCE = 0.01, 0.015  # s
FEWEST = 6  # stretches


@dataclass(frozen=True, slots=True)
class DelayEstimate:
    """``value`` ± ``std`` s; ``inside``: not at the end of what is searched.

    ``stretches``: the number of equal ones with as much information, 1/Σ share².
    """

    value: float
    std: float
    stretches: float
    inside: bool

    @property
    def reach(self) -> float:
        """Half the 95 % interval, s: Student's, one degree of freedom per stretch."""
        from scipy.stats import t

        return float(t.ppf(0.975, max(self.stretches - 1.0, 1.0))) * self.std


def estimate(stretches: Sequence[DelayStretch], shift: float = 0.0) -> DelayEstimate | None:
    """The delay that the equation of ``stretches`` asks for; None with fewer than FEWEST.

    ``shift`` s moves the range that is searched.
    """
    from scipy.optimize import minimize_scalar

    if len(stretches) < FEWEST:
        return None
    grid = np.arange(EARLIEST, LATEST + COARSE / 2, COARSE) + shift
    misfit = [float(_misfit(stretches, tau).sum()) for tau in grid]
    best = int(np.argmin(misfit))
    inside = 0 < best < len(grid) - 1
    near = grid[max(best - 1, 0)], grid[min(best + 1, len(grid) - 1)]
    tau = float(
        minimize_scalar(
            lambda tau: _misfit(stretches, tau).sum(),
            bounds=near,
            method="bounded",
            options={"xatol": 1e-5},
        ).x
    )
    # Slope and curvature of each stretch's misfit: not from the squared slope of the columns,
    # whose noise would pass for information.
    early, here, late = (_misfit(stretches, tau + h) for h in (-DIFFERENCE, 0.0, DIFFERENCE))
    score, curvature = (late - early) / (2 * DIFFERENCE), (late - 2 * here + early) / DIFFERENCE**2
    information = float(curvature.sum())
    if information <= 0.0:
        return None
    # as if each stretch had been left out in turn: one that decides alone says little of its error
    alone = np.clip(curvature / information, 0.0, 0.999)
    std = float(np.linalg.norm(score / (1 - alone))) / information
    return DelayEstimate(tau, std, float(1.0 / np.sum(alone**2)), inside)


def _misfit(stretches: Sequence[DelayStretch], tau: float) -> Floats:
    """Sum of squares per stretch of what no coefficient can explain."""
    misfit = np.empty(len(stretches))
    for i, stretch in enumerate(stretches):
        y, own = stretch.columns(tau)
        basis = np.linalg.qr(own / np.maximum(np.abs(own).max(axis=0), 1e-12))[0]
        misfit[i] = y @ y - ((basis.T @ y) ** 2).sum()
    return misfit
