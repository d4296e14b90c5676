"""Linear equations of a step, also where they have no single answer."""

from __future__ import annotations

import numpy as np

from clutchest.signals import Floats


def solved(curvature: Floats, slope: Floats) -> Floats:
    """The step (f) to where the slope is 0; the shortest of those where numbers so far off that
    derivatives overwhelm all else leave no single one."""
    try:
        return np.asarray(np.linalg.solve(curvature, slope), np.float64)
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.lstsq(curvature, slope, rcond=None)[0], np.float64)
