"""Time stamps of formats that do not state from when they count."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

EPOCH_NS = 10**17  # an earlier date, March 1973, is none
LAST_S = 7 * 10**9  # nor is a later one, in 2191


def counts_from_epoch(t_ns: NDArray[np.int64]) -> bool:
    """Whether time stamps of a format that does not state it are absolute."""
    return bool(len(t_ns) and t_ns[0] >= EPOCH_NS)
