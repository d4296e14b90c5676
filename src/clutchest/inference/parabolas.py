"""Parabolas through so many samples around each (Savitzky and Golay 1964).

scipy.signal has them too, and takes as long to load as a log of a minute to be replayed.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.ndimage import correlate1d

from clutchest.signals import Floats


def parabolas(read: Floats, count: int, rate: int = 0, apart: float = 1.0) -> Floats:
    """``read`` (K), samples ``apart`` s from each other, by the parabola through ``count`` of them,
    an odd number, around each, or the nearest so many at the ends: its value, or its first or
    second derivative with a ``rate`` of 1 or 2."""
    through, half = _through(count, rate) / apart**rate, count // 2
    fitted = correlate1d(read, through[half], mode="constant")
    fitted[:half] = through[:half] @ read[:count]
    fitted[len(read) - half :] = through[count - half :] @ read[-count:]
    return np.asarray(fitted)


@lru_cache
def _through(count: int, rate: int) -> Floats:
    """What takes samples 1 s apart to the parabola through them, or to its derivative, at each of
    them (count, count)."""
    t = np.arange(count) - float(count // 2)
    powers = np.column_stack([np.ones(count), t, t**2])
    derivatives = (powers, np.column_stack([0 * t, np.ones(count), 2 * t]), [[0.0, 0.0, 2.0]])
    return np.asarray(np.broadcast_to(derivatives[rate] @ np.linalg.pinv(powers), (count, count)))
