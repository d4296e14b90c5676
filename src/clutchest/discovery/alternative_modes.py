"""Alternative modes of the posterior: values of the unknowns past a threshold of some state, which
may improve the fit as much as a cause."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from clutchest.discovery.candidates import CandidateCause, settings
from clutchest.discovery.cause_set import CauseSet, cost_of
from clutchest.discovery.search import Search
from clutchest.inference.map_fit import curvature, improve
from clutchest.inference.multistart import multistart
from clutchest.inference.objective import Objective
from clutchest.inference.white_linearisation import Linearisation
from clutchest.signals import Floats

SHARES = (0.5, 0.0)  # of a cause's size, to which it is led one after another


def model_in_alternative_mode(search: Search) -> Search | None:
    """The search begun again in a mode in which the model without a cause fits better; None where
    there is none."""
    free = search.free(())
    null = search.objective.linearise_at(search.null.fit.theta, active=free)
    fit = multistart(search.objective, null, free)
    return None if fit is None else search.restarted_at(CauseSet((), fit))


def cause_in_alternative_mode(search: Search) -> tuple[Search, bool]:
    """Whether one of the best's causes is superfluous in another mode: it is dropped, and the
    search is to go on from there."""
    for cause in search.best.causes:
        # the model without a cause has been fitted from where its likeliest one ended
        fewer = search.without(cause, search.best) if len(search.best.causes) > 1 else search.null
        free = search.free(fewer.causes)
        near = search.objective.linearise_at(fewer.fit.theta, fewer.fit.shapes, free)
        fits = multistart(search.objective, near, free), _led_out(search, cause, fewer)
        there = min((CauseSet(fewer.causes, fit) for fit in fits if fit), key=cost_of)
        if not there.cost < fewer.cost:
            continue
        same = search.fitted(search.best.causes, there.fit)
        best = min(search.best, same, key=cost_of)
        search = replace(search, best=best)
        if there.cost - best.cost < search.least_gain(there):
            return search.restarted_at(there), True
    return search, False


def _led_out(search: Search, cause: CandidateCause, fewer: CauseSet) -> Linearisation:
    """The fit of the best without a cause, whose size is led to 0 by and by, to where ``fewer``
    stand: from where it is gone at once, a fit may end on the other side of a threshold."""
    objective, fit = search.objective, search.best.fit
    free, size = search.free(fewer.causes), fit.theta[cause.index]
    for share in SHARES:
        shapes = fit.shapes if share else settings(fewer.causes)
        theta = search.lowest(_with_size(objective, fit, cause, share * size, free), shapes)
        begin = objective.linearise_at(theta, shapes, free)
        fit = improve(objective, begin, free, derivatives=False)
    return fit


def _with_size(
    objective: Objective,
    fit: Linearisation,
    cause: CandidateCause,
    size: float,
    free: NDArray[np.int64],
) -> tuple[Floats, Floats]:
    """The numbers (m) of a fit with another ``size`` of a cause, the ``free`` ones (indices) where
    they are, and on the ridge: where they are most probable then by the curvature alone.  Where the
    cost is rough, a fit ends on a slope, and a whole step leads away from what is near."""
    there, ridge = fit.theta.copy(), fit.theta.copy()
    there[cause.index] = ridge[cause.index] = size
    numbers = np.append(free, cause.index)
    bent = curvature(objective, objective.linearise_at(fit.theta, fit.shapes, numbers), numbers)
    along = np.linalg.solve(bent[:-1, :-1], bent[:-1, -1])
    ridge[free] -= along * (size - fit.theta[cause.index])
    return there, ridge
