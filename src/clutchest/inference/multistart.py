"""Whether numbers far from the most probable ones explain the data better still.

Where a state passes a threshold only for some numbers, as the temperature difference does beyond
which a disc expands no further, no derivative at the others tells of it: each side has a most
probable place of its own.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from clutchest.inference.map_fit import SETTLED, Fitter, Look
from clutchest.signals import Floats

ASIDE = 2.0  # standard deviations, by which one looks aside
LOOSE = 0.5  # of a prior's standard deviation: a direction of which the data leave less is certain
BENT = 1.0  # of −2 ln(probability): by so much more or less than expected, there is a threshold


def multistart(fitter: Fitter, look: Look, free: NDArray[np.int64]) -> Look | None:
    """The most probable place beyond a threshold, where it is better than ``look`` at the most
    probable values of the ``free`` thetas (indices); None where there is none."""
    curvature, directions = np.linalg.eigh(fitter.curvature(look, free))
    std = curvature**-0.5
    lowest, start = look.cost, None
    for along in (directions * std).T[std > LOOSE]:
        for side in (-ASIDE, ASIDE):
            aside = _aside(fitter, look, free, side * along)
            half = _aside(fitter, look, free, side / 2.0 * along) if _bends(look, aside) else aside
            best = min(aside, half, key=lambda at: at.cost)
            if best.cost < lowest:
                lowest, start = best.cost, best.theta
    if start is None:
        return None
    found = fitter.improve(fitter.arrive(start, look.shapes, free), free)
    return found if found.cost < look.cost - SETTLED else None


def _aside(fitter: Fitter, look: Look, free: NDArray[np.int64], by: Floats) -> Look:
    """Without derivatives, at ``by`` from a look, as far as gains may go."""
    theta = look.theta.copy()
    theta[free] += by
    return fitter.look(fitter.within(theta, free), look.shapes, np.zeros(0, np.int64))


def _bends(look: Look, aside: Look) -> bool:
    """Whether the cost aside is other than that of a parabola."""
    return abs(aside.cost - look.cost - ASIDE**2) > BENT
