"""How late one signal is behind others that an equation ties it to.

Over stretches of a drive the late signal y obeys y(t) = Σ c_i x_i(t − τ): with coefficients that
all stretches share and others that each has for itself.  All columns are smoothed alike (which
commutes with the equation), the coefficients are eliminated, and τ minimises what is left.  Its
standard deviation is clustered by stretch: whatever the noise is like within one, stretches are
taken to be independent.
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

Columns = Callable[[float], tuple[Floats, Floats, Floats]]


@dataclass(frozen=True, slots=True)
class Stretch:
    """``columns(delay)`` gives y (n,), shared (n, p) and own (n, q) columns of the equation."""

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
    left, part, shared = _left(stretches, tau)
    slope = (_left(stretches, tau + DIFFERENCE)[0] - _left(stretches, tau - DIFFERENCE)[0]) / (
        2 * DIFFERENCE
    )
    if shared.shape[1]:  # along what the shared coefficients cannot undo
        slope = slope - shared @ np.linalg.lstsq(shared, slope, rcond=None)[0]
    information = float(slope @ slope)
    count = len(stretches)
    if information <= 0.0:
        return None
    # as if each stretch had been left out in turn: one that decides alone says little of its error
    share = np.bincount(part, slope * slope, count) / information
    scores = np.bincount(part, slope * left, count) / np.maximum(1 - share, 1e-3)
    std = float(np.sqrt((scores**2).sum())) / information
    return Delay(tau, std, count, inside)


def _left(stretches: Sequence[Stretch], tau: float) -> tuple[Floats, NDArray[np.intp], Floats]:
    """What is left of y, of which stretch each row is, and the shared columns less the own."""
    lefts, parts, shares = [], [], []
    for i, stretch in enumerate(stretches):
        y, shared, own = stretch.columns(tau)
        both = np.column_stack([y, shared])
        basis = np.linalg.qr(own / np.maximum(np.abs(own).max(axis=0), 1e-12))[0]
        both = both - basis @ (basis.T @ both)
        lefts.append(both[:, 0])
        shares.append(both[:, 1:])
        parts.append(np.full(len(y), i))
    left, shared = np.concatenate(lefts), np.concatenate(shares)
    if shared.shape[1]:
        left = left - shared @ np.linalg.lstsq(shared, left, rcond=None)[0]
    return left, np.concatenate(parts), shared
