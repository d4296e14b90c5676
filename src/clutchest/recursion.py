"""The recursion behind every autocorrelated noise."""

from __future__ import annotations

import numpy as np

from clutchest.native import compiled
from clutchest.signals import Floats


@compiled
def recur(drive: Floats, keep: float) -> Floats:
    """A first-order recursion: out[k] = keep · out[k − 1] + drive[k]; shape (n,)."""
    out = np.empty_like(drive)
    last = 0.0
    for k in range(len(drive)):
        last = keep * last + drive[k]
        out[k] = last
    return out
