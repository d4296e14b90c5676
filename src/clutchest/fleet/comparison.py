"""Vehicles compared with the fleet that they belong to: what is normal is learned from it.

Two levels: a vehicle's number is what was estimated, y_v ± s_v; its true value is normal around the
fleet's mean μ with the fleet's spread τ.  A vehicle is judged by the others: given these, y_v is
normal around their mean with variance τ² + s_v² + var(μ), its tails Student's because τ is known
from few vehicles only.  [Higgins, Thompson, Spiegelhalter 2009, J. R. Statist. Soc. A 172, §4]
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clutchest.signals import Floats

FEWEST = 4  # vehicles; the others of fewer tell no spread
LEVEL = 0.01  # of one false outlier in a whole fleet
NEAR = 4.0
NORMAL = 1.4826  # standard deviation of a normal distribution over its median deviation
_STEPS = 200  # of τ, of which the most probable one is taken


@dataclass(frozen=True, slots=True)
class FleetComparison:
    """Of v vehicles: what the others of the fleet lead one to expect (``expected`` ± ``spread``),
    and the ``p_value`` of what was estimated, (v,) each; NaN where that cannot be said."""

    expected: Floats
    spread: Floats
    p_value: Floats


def fleet_level(y: Floats, std: Floats) -> tuple[float, float, float]:
    """Mean μ of the fleet, its variance, and the spread τ between vehicles (restricted maximum
    likelihood), of estimates ``y`` ± ``std`` (v,)."""
    reach = max(float(np.ptp(y)), float(std.max()), 1e-300)
    tau = np.concatenate([[0.0], reach * np.geomspace(1e-4, 3.0, _STEPS)])
    weight = 1.0 / (tau[:, None] ** 2 + std**2)
    total = weight.sum(1)
    mean = (weight * y).sum(1) / total
    misfit = (weight * (y - mean[:, None]) ** 2).sum(1)
    best = int(np.argmax(np.log(weight).sum(1) - np.log(total) - misfit))
    return float(mean[best]), float(1.0 / total[best]), float(tau[best])


def compare(y: Floats, std: Floats, others: NDArray[np.bool_] | None = None) -> FleetComparison:
    """Every vehicle against the rest; ``others`` (v,) may be counted among the rest."""
    from scipy.special import (
        stdtr,
    )  # of Student's distribution: scipy.stats loads for half a second

    n = len(y)
    counted = np.ones(n, bool) if others is None else others
    expected, spread, p_value = (np.full(n, np.nan) for _ in range(3))
    for v in range(n):
        rest = counted & (np.arange(n) != v) & np.isfinite(y)
        if not np.isfinite(y[v]) or rest.sum() < FEWEST - 1:
            continue
        mean, variance, tau = fleet_level(y[rest], std[rest])
        expected[v] = mean
        spread[v] = np.sqrt(tau**2 + std[v] ** 2 + variance)
        p_value[v] = 2.0 * stdtr(rest.sum() - 1, -abs(y[v] - mean) / spread[v])
    return FleetComparison(expected, spread, p_value)


def outliers(y: Floats, std: Floats, tests: int) -> tuple[FleetComparison, NDArray[np.bool_]]:
    """Vehicles that are none of the fleet's, where one in ``1 / LEVEL`` fleets has a false one
    among ``tests`` numbers.

    Several hide each other, because they widen the spread: to begin with only those count as the
    rest that lie within ``NEAR`` robust standard deviations of the median, from then on all that
    are not found.
    """
    known = np.isfinite(y)
    away = np.abs(y - np.median(y[known])) if known.any() else y
    scale = np.sqrt((NORMAL * np.median(away[known])) ** 2 + std**2) if known.any() else std
    found = away > NEAR * scale
    for _ in range(len(y)):
        comparison = compare(y, std, ~found)
        now = comparison.p_value < LEVEL / tests
        if np.array_equal(now, found):
            break
        found = now
    return comparison, now
