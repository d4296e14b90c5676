"""The interval of a gain that was looked at before it was reported.

Held-out drives may reject a result that might be noise.  What gains too little there is not
reported, so of those reported the larger ones are too many.  The interval asks which true gains
make the measured one neither too large nor too small among those that are reported: of a normal
distribution, truncated (J. D. Lee, D. L. Sun, Y. Sun and J. E. Taylor, Ann. Stat. 44 (2016) 907,
section 4).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.optimize import brentq
from scipy.special import log_ndtr, ndtri

from clutchest.discovery.result import Gain

LEVELS = 0.975, 0.025  # of reported gains, those below the measured one, at either end: 95 %
FURTHEST = 100.0  # standard deviations below the measured gain, where the search for an end stops


def given_above(gain: Gain, least: float) -> Gain:
    """A gain that is reported only where it is ``least`` at least, with an interval that allows for
    that; as it is where it would have been reported in any case (−∞)."""
    low, high = gain.ci95
    std = float((high - low) / (ndtri(LEVELS[0]) - ndtri(LEVELS[1])))
    if least == -np.inf or std <= 0.0:
        return gain

    def end(share: float) -> float:
        """The true gain, in standard deviations above ``least``, at which such a share of those
        reported is smaller than the measured one."""
        measured = (gain.total - least) / std

        def excess(true: float) -> float:
            return float(log_ndtr(true - measured) - log_ndtr(true) - np.log1p(-share))

        lowest, highest = measured - FURTHEST, measured + FURTHEST
        if excess(lowest) > 0.0:
            return lowest
        return float(brentq(excess, lowest, highest))

    ends = [float(least + std * end(share)) for share in LEVELS]
    return replace(gain, ci95=(ends[0], ends[1]))
