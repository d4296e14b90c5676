"""Noise as it is beside the likeliest error without a name.

Noise is estimated from what the model leaves, and an autoregressive model takes an error of the
equations that lasts for seconds for slow noise: in noise of that colour, its own curve explains
little.  So once an error is established, curves that lead are compared each with the noise that it
leaves itself, by the likelihood with the determinant of the noise's covariance in it.  They are
fitted to first order, and compared with no curve, whose noise begins from white as theirs does.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from clutchest.discovery.curve_portions import held, portions
from clutchest.discovery.nuisances import Nuisances
from clutchest.discovery.own_noise import ENOUGH, SLIGHT, as_loud, as_noise
from clutchest.discovery.refitted_curves import WIDEST, comes_and_goes
from clutchest.discovery.residual_curves import Curve, CurvesAt, curves, places
from clutchest.discovery.search import Search
from clutchest.inference.covariates import hats
from clutchest.inference.linear_solve import solved
from clutchest.inference.linearisation import Modulation
from clutchest.inference.map_fit import TURNS, improve
from clutchest.inference.noise_model import NoiseModel
from clutchest.inference.objective import Objective
from clutchest.inference.white_linearisation import Linearisation
from clutchest.signals import Floats

LEADERS = 8  # curves that are compared, in white noise and in noise as the model shows it each


def with_noise_beside_curves(search: Search, errors: Sequence[Curve]) -> Search:
    """The search with the noise that the likeliest curve leaves, where it is far likelier than
    none; ``errors`` of its model without a cause in noise as that leaves it."""
    objective, null, free = search.objective, search.null.fit, search.free(())
    at = objective.linearise_at(null.theta, null.shapes)
    begin = as_loud(search)
    white = replace(begin.whitened(at), raw=())
    plain = curves(begin, white, Nuisances(white, free, begin.prior), seed=3)
    known = CurvesAt.of(objective, at)
    tables = [np.column_stack([each.r, each.psi[:, free]]) for each in at.raw]
    beside = _Linear(tables, objective.prior[free], at.theta[free])
    none = best = _in_own_noise(objective, beside)
    for some in portions(_leading(plain, errors, search), held(at)):
        for columns in _derivatives(known, at, some):
            own = _in_own_noise(objective, beside.beside(columns))
            best = min(best, own, key=lambda likely: likely.cost)
    if none.cost - best.cost < ENOUGH:
        return search
    objective = objective.in_noise(best.rest).with_discrepancies(at)
    fit = improve(objective, objective.white_at(null.theta, null.shapes), free, derivatives=False)
    return replace(search, objective=objective, null=replace(search.null, fit=fit))


def _leading(plain: Sequence[Curve], errors: Sequence[Curve], search: Search) -> list[Curve]:
    """The curves that lead in white noise, and those that do in noise as the model shows it, and
    those that lead in each way of being wrong; none that comes and goes within seconds, as any
    noise does."""
    brief = search.problem.compiled.machine.durations
    found: dict[tuple[str, str, int], Curve] = {}
    for each in (plain, errors):
        steady = [curve for curve in each if not comes_and_goes(curve, brief)]
        firsts = {curve.error_term: curve for curve in reversed(steady)}.values()
        found |= {(c.error_term, c.covariate, len(c.at)): c for c in (*steady[:LEADERS], *firsts)}
    return list(found.values())


def _derivatives(
    known: CurvesAt, at: Linearisation, some: Sequence[Curve]
) -> Iterator[list[Floats]]:
    """By the coefficients of each of ``some`` curves (K, c), of every drive, before whitening."""
    place, counts = places(known.problem), [len(curve.at) for curve in some]
    thetas = np.repeat([place[curve.error_term] for curve in some], counts)
    columns = np.arange(len(thetas))
    how = [
        Modulation(np.column_stack([hats(values[c.covariate], c.at) for c in some]), columns)
        for values in known.values
    ]
    tables = known.problem.modulated(at.theta, at.shapes, at.implied, thetas, how)
    for end, count in zip(np.cumsum(counts), counts, strict=True):
        yield [table[:, end - count : end] for table in tables]


class _Linear(NamedTuple):
    """Innovations and their derivatives by n unknowns (K, 1 + n) of every drive, ``prior`` (n) the
    precision of these and ``begin`` (n) where they are."""

    tables: list[Floats]
    prior: Floats
    begin: Floats

    def beside(self, columns: Sequence[Floats]) -> _Linear:
        """With the coefficients of a curve, by whose derivatives (K, c) of every drive."""
        pairs = zip(self.tables, columns, strict=True)
        prior = np.full(columns[0].shape[1], WIDEST**-2.0)
        return _Linear(
            [np.column_stack(each) for each in pairs],
            np.append(self.prior, prior),
            np.append(self.begin, 0.0 * prior),
        )


class _Likely(NamedTuple):
    """−2 ln(probability) of most probable unknowns in noise as they leave it, and what is left (K)
    of every drive's innovations."""

    cost: float
    rest: list[Floats]


def _in_own_noise(objective: Objective, of: _Linear) -> _Likely:
    """Found in turns, from white noise on."""
    rest = [table[:, 0] for table in of.tables]
    best, noise = _Likely(np.inf, rest), NoiseModel.fit(objective.stretches, rest, longest=0)
    for _ in range(TURNS):
        pairs = zip(objective.stretches, of.tables, strict=True)
        white = (noise.whiten(s, table) for s, table in pairs)
        products = np.sum([each.T @ each for each in white], axis=0)
        inner = products[1:, 1:] + np.diag(of.prior + 1e-9)
        step = -solved(inner, products[1:, 0] + of.prior * of.begin)
        rest = [table[:, 0] + table[:, 1:] @ step for table in of.tables]
        cost, noise = as_noise(objective, rest)
        cost += float(np.sum(of.prior * (of.begin + step) ** 2))
        if cost > best.cost - SLIGHT:
            break
        best = _Likely(cost, rest)
    return best
