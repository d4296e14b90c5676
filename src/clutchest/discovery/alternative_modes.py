"""Numbers past a threshold of some state, where they do as much as a cause."""

from __future__ import annotations

from clutchest.discovery.search import Hypothesis, Search
from clutchest.inference.multistart import multistart


def model_in_alternative_mode(search: Search) -> bool:
    """Whether the model as it is explains the data better past a threshold: then it is there."""
    null = search.objective.linearise_at(search.null.fit.theta)
    fit = multistart(search.objective, null, search.free(()))
    if fit is not None:
        search.move_to(Hypothesis((), fit))
    return fit is not None


def cause_in_alternative_mode(search: Search) -> bool:
    """Whether one of the best's causes brings too little beside numbers past a threshold: then it
    goes, and there may be others to find."""
    for cause in search.best.chosen:
        fewer = search.without(cause)
        fit = multistart(search.objective, fewer.fit, search.free(fewer.chosen))
        if fit is None:
            continue
        there, again = Hypothesis(fewer.chosen, fit), search.fitted(search.best.chosen, fit)
        search.best = best = min(search.best, again, key=lambda h: h.cost)
        if there.cost - best.cost < search.least_gain(there):
            search.move_to(there)
            return True
    return False
