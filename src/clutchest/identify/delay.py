"""How late one signal is behind others that an equation ties it to.

Over stretches of a drive the late signal y obeys y(t) = x_0(t − τ) + Σ c_i x_i(t − τ), with
coefficients c_i that each stretch has for itself.  All columns are smoothed alike (which commutes
with the equation), the coefficients are eliminated, and τ minimises what is left.  Its standard
deviation is clustered by stretch: whatever the noise is like within one, stretches are taken to
be independent.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clutchest.signals import Floats

EARLIEST, LATEST = -0.15, 0.45  # s, searched
COARSE, DIFFERENCE = 0.01, 0.004  # s
FEWEST = 6  # stretches

Columns = Callable[[float], tuple[Floats, Floats]]


@dataclass(frozen=True, slots=True)
class Stretch:
    """``columns(delay)`` gives y − x_0 (n,) and the columns x_i (n, q) of the equation."""

    columns: Columns


@dataclass(frozen=True, slots=True)
class Delay:
    """``value`` ± ``std`` s from ``stretches``; ``inside``: not at the end of what is searched."""

    value: float
    std: float
    stretches: int
    inside: bool

    @property
    def reach(self) -> float:
        """Half the 95 % interval, s: Student's, one degree of freedom per stretch."""
        from scipy.stats import t

        return float(t.ppf(0.975, self.stretches - 1)) * self.std


def estimate(stretches: Sequence[Stretch], shift: float = 0.0) -> Delay | None:
    """The delay that the equation of ``stretches`` asks for; None with fewer than FEWEST.

    ``shift`` s moves the range that is searched.
    """
    from scipy.optimize import minimize_scalar

    if len(stretches) < FEWEST:
        return None
    grid = np.arange(EARLIEST, LATEST + COARSE / 2, COARSE) + shift
    misfit = [float((_left(stretches, tau)[0] ** 2).sum()) for tau in grid]
    best = int(np.argmin(misfit))
    inside = 0 < best < len(grid) - 1
    near = grid[max(best - 1, 0)], grid[min(best + 1, len(grid) - 1)]
    found = minimize_scalar(lambda tau: float((_left(stretches, tau)[0] ** 2).sum()), bounds=near,
                            method="bounded", options={"xatol": 1e-5})  # fmt: skip
    tau = float(found.x)
    left, part = _left(stretches, tau)
    slope = (_left(stretches, tau + DIFFERENCE)[0] - _left(stretches, tau - DIFFERENCE)[0]) / (
        2 * DIFFERENCE
    )
    information = float(slope @ slope)
    count = len(stretches)
    if information <= 0.0:
        return None
    # as if each stretch had been left out in turn: one that decides alone says little of its error
    share = np.bincount(part, slope * slope, count) / information
    scores = np.bincount(part, slope * left, count) / np.maximum(1 - share, 1e-3)
    std = float(np.sqrt((scores**2).sum())) / information
    return Delay(tau, std, count, inside)


def _left(stretches: Sequence[Stretch], tau: float) -> tuple[Floats, NDArray[np.intp]]:
    """What no coefficient can explain, and of which stretch each row is; (n,) each."""
    lefts, parts = [], []
    for i, stretch in enumerate(stretches):
        y, own = stretch.columns(tau)
        basis = np.linalg.qr(own / np.maximum(np.abs(own).max(axis=0), 1e-12))[0]
        lefts.append(y - basis @ (basis.T @ y))
        parts.append(np.full(len(y), i))
    return np.concatenate(lefts), np.concatenate(parts)
