"""Alternative modes of the posterior: values of the unknowns past a threshold of some state, which
may improve the fit as much as a cause."""

from __future__ import annotations

from dataclasses import replace

from clutchest.discovery.cause_set import CauseSet, cost_of
from clutchest.discovery.search import Search
from clutchest.inference.multistart import multistart


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
        fit = multistart(search.objective, near, free)
        if fit is None:
            continue
        there, same = CauseSet(fewer.causes, fit), search.fitted(search.best.causes, fit)
        best = min(search.best, same, key=cost_of)
        search = replace(search, best=best)
        if there.cost - best.cost < search.least_gain(there):
            return search.restarted_at(there), True
    return search, False
