"""Whether numbers that a fit left implausibly far off can be led home, to a better one.

Two numbers of which the data tell the product, as heat and what it expands, share a bent ridge.
Steps end on it wherever it bends, though it may be far from where their priors would have them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from clutchest.inference.map_fit import SLIGHT, Fitter, Look

ODD = 3.0  # standard deviations of its prior, from which on a number is led home
HOMEWARD = (0.75, 0.5, 0.25, 0.0)  # of its distance


def continue_towards_prior(fitter: Fitter, look: Look, free: NDArray[np.int64]) -> Look:
    """The fit ``look`` of the ``free`` thetas (indices), or a better one to which it leads to hold
    the farthest of them nearer and nearer home while the others make the best of that."""
    off = np.abs(look.theta[free]) * (fitter.prior[free] > 0.0)
    if not len(free) or off.max() < ODD:
        return look
    home = _led(fitter, look, free, int(free[np.argmax(off)]))
    if home is look:
        return look
    better = fitter.improve(fitter.look(home.theta, look.shapes, free), free)
    return continue_towards_prior(fitter, better, free)


def _led(fitter: Fitter, look: Look, free: NDArray[np.int64], i: int) -> Look:
    """The best fit of the others on the way home of the ``i``-th, which ends where a step does not
    make it better."""
    best, others = look, free[free != i]
    for share in HOMEWARD:
        theta = best.theta.copy()
        theta[i] = share * look.theta[i]
        nearer = fitter.improve(fitter.arrive(theta, look.shapes, others), others)
        if nearer.cost > best.cost - SLIGHT:
            break
        best = nearer
    return best
