"""One module per kind of log file that can be read."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def counts_from_epoch(t_ns: NDArray[np.int64]) -> bool:
    """Whether time stamps of a format that does not say so are absolute: after March 1973."""
    return bool(len(t_ns) and t_ns[0] >= 10**17)
