"""Continuation: a fit with numbers implausibly far from their priors is continued towards them.

Two numbers of which the data determine the product, as heat and what it expands, share a bent
ridge.  Steps end on it wherever it bends, though it may be far from where their priors are.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from clutchest.inference.map_fit import improve
from clutchest.inference.objective import Objective
from clutchest.inference.white_linearisation import Linearisation
from clutchest.signals import Floats

ODD = 3.0  # standard deviations of its prior, from which on a number is continued towards it
FURTHER = 1.0  # the same: than in the fit without what may have led it there
SHARES = (0.75, 0.5, 0.25, 0.0)  # of its distance, at which it is held in turn
SLIGHT = 2.0  # of −2 ln(probability): a share that gained less was the last


def continue_towards_prior(
    objective: Objective, fit: Linearisation, free: NDArray[np.int64], known: Floats
) -> Linearisation:
    """The ``fit`` of the ``free`` thetas (indices), or a better one that is reached by holding the
    farthest of them nearer and nearer to its prior while the others are fitted.  One that is no
    further off than in a ``known`` fit (m) of fewer of them is where the data have it."""
    off = np.abs(fit.theta[free]) * (objective.prior[free] > 0.0)
    off[off < np.abs(known[free]) + FURTHER] = 0.0
    if not len(free) or off.max() < ODD:
        return fit
    nearer = _continued(objective, fit, free, int(free[np.argmax(off)]))
    if nearer is fit:
        return fit
    begin = objective.linearise_at(nearer.theta, fit.shapes, free)
    better = improve(objective, begin, free, derivatives=False)
    return continue_towards_prior(objective, better, free, known)


def _continued(
    objective: Objective, fit: Linearisation, free: NDArray[np.int64], i: int
) -> Linearisation:
    """The best fit of the others on the way of the ``i``-th to its prior, which ends where a step
    does not make it better."""
    best, others = fit, free[free != i]
    for share in SHARES:
        theta = best.theta.copy()
        theta[i] = share * fit.theta[i]
        begin = objective.linearise_at(theta, fit.shapes, others)
        nearer = improve(objective, begin, others, derivatives=False)
        if nearer.cost > best.cost - SLIGHT:
            break
        best = nearer
    return best
