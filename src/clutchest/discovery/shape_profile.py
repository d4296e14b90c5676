"""Profile likelihood of the shapes of effects between the values that a search tries.

A shape, such as the temperature from which a lining fades, enters the equations nonlinearly: a
search tries a few values.  Around the best of them the profile likelihood is evaluated as far as
the data allow; how the gain varies along it adds to the gain's variance.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import PchipInterpolator

from clutchest.discovery.candidates import CandidateCause
from clutchest.discovery.cause_set import CauseSet, cost_of
from clutchest.discovery.search import CLOSE, Search
from clutchest.models.effects import Number
from clutchest.signals import Floats

FINER = 4  # values for each that the search tries
FAR = 6.0  # of 2 Δ ln L: a value that is so much less likely is the last
MOST = 2 * FINER  # values on each side
CLEAR, HALVED = 1.0, 3  # the same: by which both values beside the best may be less likely; else
# others between them are tried, so many times at most
BETWEEN = 200  # values between those tried, at which the probability is read off


@dataclass(frozen=True, slots=True)
class Spread:
    """The uncertainty of shapes: the ``variance`` (m) that it adds to that of θ, and the standard
    deviation of each shape by the names of its effect and itself."""

    variance: Floats
    std: Mapping[tuple[str, str], float]


def refine(search: Search) -> tuple[Search, dict[frozenset[str], Spread]]:
    """The search with its best, and rivals that are close, at the most probable values of their
    shapes; the uncertainty of these, by the names of a cause set."""
    near, spreads = search.best.cost + CLOSE, dict[frozenset[str], Spread]()
    refined: dict[frozenset[str], CauseSet] = {}
    for h in (search.best, *search.rivals):
        if h.names not in refined:
            refined[h.names] = h
            if h.cost < near:
                refined[h.names], spreads[h.names] = _refined(search, h)
    best, *rivals = sorted(refined.values(), key=cost_of)
    return replace(search, best=best, rivals=tuple(rivals)), spreads


def _refined(search: Search, h: CauseSet) -> tuple[CauseSet, Spread]:
    variance, std = np.zeros(len(h.fit.theta)), dict[tuple[str, str], float]()
    for i, cause in enumerate(h.causes):
        for key, _ in cause.shapes:
            if len(_number(cause, key).grid) > 1 and len(tried := _tried(search, h, i, key)) > 1:
                best, h = min(tried.items(), key=lambda each: each[1].cost)
                at = np.array([*tried])
                value = np.linspace(at[0], at[-1], BETWEEN)
                cost = PchipInterpolator(at, [other.cost for other in tried.values()])(value)
                share = np.exp(-(cost - cost.min()) / 2.0)
                share /= share.sum()
                theta = np.array([other.fit.theta for other in tried.values()])
                off = PchipInterpolator(at, theta)(value) - h.fit.theta
                variance += share @ off**2
                std[cause.name, key] = float(np.sqrt(share @ (value - best) ** 2))
    return h, Spread(variance, std)


def _tried(search: Search, h: CauseSet, i: int, key: str) -> dict[float, CauseSet]:
    """Fits at values of one shape of the i-th cause, in order: on both sides as far as they are
    likely and plausible, and as close as the data separate them."""
    number, first = _number(h.causes[i], key), dict(h.causes[i].shapes)[key]
    grid = np.sort(number.grid)
    after = int(np.clip(np.searchsorted(grid, first), 1, len(grid) - 1))
    step = 2**HALVED  # in the smallest steps
    small = float(grid[after] - grid[after - 1]) / FINER / step
    tried = {0: h}  # by steps from the first

    def lowest() -> float:
        return min(other.cost for other in tried.values())

    def fit(place: int, near: CauseSet) -> float:
        """The cost there, infinite where it is not plausible."""
        if not number.lower <= (value := first + place * small) <= number.upper:
            return np.inf
        cause = near.causes[i]
        shapes = tuple((k, value if k == key else v) for k, v in cause.shapes)
        causes = (*near.causes[:i], replace(cause, shapes=shapes), *near.causes[i + 1 :])
        tried[place] = search.fitted_near(causes, near.fit).bare
        return tried[place].cost

    for side in (-step, step):
        for place in side * np.arange(1, MOST + 1):
            if fit(int(place), tried[int(place) - side]) > lowest() + FAR:
                break
    for _ in range(HALVED):
        best = min(tried, key=lambda place: tried[place].cost)
        beside = [tried[place].cost for place in (best - step, best + step) if place in tried]
        if min(beside, default=np.inf) < lowest() + CLEAR:
            break
        step //= 2
        for place in (best - step, best + step):
            fit(place, tried[best])
    return {first + place * small: tried[place] for place in sorted(tried)}


def _number(cause: CandidateCause, key: str) -> Number:
    return next(number for number in cause.effect.parameters if number.key == key)
