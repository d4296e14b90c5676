"""Shapes of effects between the values that a search tries, and how well they are known.

A shape, such as the temperature from which a lining fades, bends the equations as it likes, so that
a search tries a few values.  Around the best of them more are tried, as far as the data allow; what
the gain is at each of them adds to what is not known of it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from clutchest.discovery.candidates import Candidate
from clutchest.discovery.search import CLOSE, Hypothesis, Search
from clutchest.models.effects import Number
from clutchest.signals import Floats

FINER = 4  # values for each that the search tries
FAR = 6.0  # of −2 ln(probability): a value that is so much less likely is the last
MOST = 2 * FINER  # values on each side


@dataclass(frozen=True, slots=True)
class Spread:
    """What is not known of shapes: ``variance`` (m) that it adds to that of θ, and the standard
    deviation of each shape by the names of its effect and itself."""

    variance: Floats
    std: Mapping[tuple[str, str], float]


def refine(search: Search) -> dict[frozenset[str], Spread]:
    """Take the best, and rivals that are close, to the most probable values of their shapes; what
    is then not known of these, by the hypothesis' names."""
    near, spreads = search.best.cost + CLOSE, dict[frozenset[str], Spread]()
    met: dict[frozenset[str], Hypothesis] = {}
    for h in (search.best, *search.rivals):
        if h.names not in met:
            met[h.names] = h
            if h.cost < near:
                met[h.names], spreads[h.names] = _refined(search, h)
    search.best, *search.rivals = sorted(met.values(), key=lambda h: h.cost)
    return spreads


def _refined(search: Search, h: Hypothesis) -> tuple[Hypothesis, Spread]:
    variance, std = np.zeros(len(h.look.theta)), dict[tuple[str, str], float]()
    for i, cause in enumerate(h.chosen):
        for key, _ in cause.shapes:
            if len(_number(cause, key).grid) > 1:
                tried = dict(_around(search, h, i, key))
                cost = np.array([other.cost for other in tried.values()])
                share = np.exp(-(cost - cost.min()) / 2.0)
                share /= share.sum()
                value, h = min(tried.items(), key=lambda each: each[1].cost)
                theta = np.array([other.look.theta for other in tried.values()])
                variance += share @ (theta - h.look.theta) ** 2
                std[cause.name, key] = float(np.sqrt(share @ (np.array([*tried]) - value) ** 2))
    return h, Spread(variance, std)


def _around(search: Search, h: Hypothesis, i: int, key: str) -> Iterator[tuple[float, Hypothesis]]:
    """Fits (value, hypothesis) at values of one shape of the i-th cause, on both sides as far as
    they are likely and plausible."""
    cause, lowest = h.chosen[i], h.cost
    number, first = _number(cause, key), dict(cause.shapes)[key]
    grid = np.sort(number.grid)
    after = int(np.clip(np.searchsorted(grid, first), 1, len(grid) - 1))
    step = float(grid[after] - grid[after - 1]) / FINER
    yield first, h
    for side in (-step, step):
        last = h
        for value in first + side * np.arange(1, MOST + 1):
            if not number.lower <= value <= number.upper:
                break
            shapes = tuple((k, float(value) if k == key else v) for k, v in cause.shapes)
            chosen = (*h.chosen[:i], replace(cause, shapes=shapes), *h.chosen[i + 1 :])
            last = search.fitted(chosen, last.look).bare
            lowest = min(lowest, last.cost)
            if last.cost > lowest + FAR:
                break
            yield float(value), last


def _number(cause: Candidate, key: str) -> Number:
    return next(number for number in cause.effect.parameters if number.key == key)
