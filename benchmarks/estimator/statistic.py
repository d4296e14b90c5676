"""Intervals by bootstrap over drives."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

RESAMPLES = 2000


def interval(
    values: NDArray[np.float64], statistic: Callable[[NDArray[np.float64]], NDArray[np.float64]]
) -> dict[str, float]:
    """``statistic`` of the mean over drives of ``values`` (drives, k), with its 95 % interval."""
    random = np.random.default_rng(0)
    rows = random.integers(0, len(values), (RESAMPLES, len(values)))
    low, high = np.percentile(statistic(values[rows].mean(axis=1)), [2.5, 97.5])
    return {"value": float(statistic(values.mean(axis=0))), "low": float(low), "high": float(high)}
