"""Blocks of a problem's readings in each of which noise may be of one kind."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from clutchest.inference.problem import Problem

LEAST_TIME, LEAST_READINGS = 2.0, 16  # s, and as many readings of a slow record at least


def noise_blocks(problem: Problem) -> NDArray[np.int64]:
    """The number of the block that every reading (K) is in."""
    steps = [np.diff(np.unique(drive.readings.t)) for drive in problem.drives]
    period = np.median(np.concatenate([*steps, np.zeros(0)])) if any(map(len, steps)) else 0.0
    return problem.blocks(max(LEAST_TIME, LEAST_READINGS * float(period)))
