"""Linear equations of a step, also where they have no single answer; products of long tables."""

from __future__ import annotations

import numpy as np

from clutchest.signals import Floats

CHUNK = 16384  # rows of a long table that are multiplied at a time


def solved(curvature: Floats, slope: Floats) -> Floats:
    """The step (f) to where the slope is 0; the shortest of those where numbers so far off that
    derivatives overwhelm all else leave no single one."""
    try:
        return np.asarray(np.linalg.solve(curvature, slope), np.float64)
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.lstsq(curvature, slope, rcond=None)[0], np.float64)


def add_product(into: Floats, table: Floats, by: Floats) -> None:
    """``into`` (K, c) += ``table`` (K, m) · ``by`` (m, c), in place, without room for the product
    of all rows."""
    for begin in range(0, len(into), CHUNK):
        into[begin : begin + CHUNK] += table[begin : begin + CHUNK] @ by
