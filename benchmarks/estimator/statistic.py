"""Intervals by bootstrap over drives, and how they are written."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

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


def percentiles(values: NDArray[np.float64]) -> dict[str, float]:
    """The median, and what nine of ten ``values`` lie between."""
    low, value, high = np.percentile(values, [5, 50, 95])
    return {"value": float(value), "low": float(low), "high": float(high)}


def shown(found: Mapping[str, float], form: str = ".3f") -> str:
    """An interval as text: value [low, high]."""
    value, low, high = (format(found[key], form) for key in ("value", "low", "high"))
    return f"{value} [{low}, {high}]"


def line(name: str, cells: Iterable[str], width: int) -> str:
    """One row of a table: its name, then cells of ``width``."""
    return f"{name:17}" + "".join(cell.rjust(width) for cell in cells)
