"""Multistart: whether numbers far from the most probable ones explain the data better still.

Where a state passes a threshold only for some numbers, as the temperature difference does beyond
which a disc expands no further, no derivative at the others shows it: each side has a most probable
place of its own.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from clutchest.inference.cores import shared
from clutchest.inference.innovations import NO_DERIVATIVES
from clutchest.inference.map_fit import SETTLED, curvature, improve
from clutchest.inference.objective import Objective
from clutchest.inference.white_linearisation import Linearisation
from clutchest.signals import Floats

ASIDE = 2.0  # standard deviations, by which starts lie aside
LOOSE = 0.5  # of a prior's standard deviation: a direction of which the data leave less is certain
BENT = 1.0  # of −2 ln(probability): by so much more or less than expected, there is a threshold


def multistart(
    objective: Objective, fit: Linearisation, free: NDArray[np.int64]
) -> Linearisation | None:
    """The most probable place beyond a threshold, where it is better than the ``fit`` of the
    ``free`` thetas (indices); None where there is none."""
    squares, directions = np.linalg.eigh(curvature(objective, fit, free))
    loose = (squares > 0.0) & (squares < LOOSE**-2.0)  # rounding makes some of the certain negative
    along = (directions[:, loose] * squares[loose] ** -0.5).T
    ways = [side * way for way in along for side in (-ASIDE, ASIDE)]
    places = shared(lambda by: _lowest_aside(objective, fit, free, by), ways)
    start = min(places, key=lambda at: at.cost, default=fit)
    if not start.cost < fit.cost:
        return None
    begin = objective.linearise_at(start.theta, fit.shapes, free)
    other = improve(objective, begin, free, derivatives=False)
    return other if other.cost < fit.cost - SETTLED else None


def _lowest_aside(
    objective: Objective, fit: Linearisation, free: NDArray[np.int64], by: Floats
) -> Linearisation:
    """At ``by`` from a fit, or halfway there where the cost is no parabola's."""
    aside = _aside(objective, fit, free, by)
    if abs(aside.cost - fit.cost - ASIDE**2) <= BENT:
        return aside
    return min(aside, _aside(objective, fit, free, by / 2.0), key=lambda at: at.cost)


def _aside(
    objective: Objective, fit: Linearisation, free: NDArray[np.int64], by: Floats
) -> Linearisation:
    """Without derivatives, at ``by`` from a fit, as far as gains may go."""
    theta = fit.theta.copy()
    theta[free] += by
    return objective.linearise_at(
        objective.within_bounds(theta, free), fit.shapes, NO_DERIVATIVES
    ).bare
