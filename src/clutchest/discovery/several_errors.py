"""More than one error without a name: forward selection of equations, each established beside
curves in those before, and backward elimination of those that stood in for others.

What one wrong equation does shows in others too, and one curve there may be likelier than any one
in itself: an error goes with several covariates.  So equations are ranked by all their curves
together.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from clutchest.discovery.curve_evidence import evidence
from clutchest.discovery.residual_curves import (
    NEGLIGIBLE,
    CandidateCurve,
    Curve,
    CurvesAt,
    Nuisances,
    places,
)
from clutchest.discovery.search import Search
from clutchest.inference.score_test import Projection
from clutchest.signals import Floats

MOST = 3  # equations
COVARIATES = 8  # of an equation: curves over so many at once stand for its error
WIDEST = 10.0  # standard deviation of these, in units of an error
SEED = 5


def several_errors(search: Search, errors: Sequence[Curve], level: float) -> list[list[Curve]]:
    """The equations that have an error, each by its curves, the most likely first: those of the
    model without a cause, ``errors``, and others that are significant at a family-wise ``level``
    beside curves over all leading covariates of the rest."""
    null = search.null.fit
    fit = search.objective.white_at(null.theta, null.shapes)
    at = CurvesAt.of(search.objective, fit)
    bare = Nuisances(fit, search.free(()), search.objective.prior)
    found = [_of_equation(errors, errors[0].equation)]
    columns = [_columns(at, found[0])]
    while len(found) < MOST:
        beside = _beside(bare, columns)
        known = {each[0].equation for each in found}
        left = [c for c in at.tested(beside, at.every(), SEED) if c.equation not in known]
        if not left or left[0].p_value >= level:
            break
        found.append(_of_equation(left, left[0].equation))
        columns.append(_columns(at, found[-1]))
    if len(found) == 1:
        return found
    first, *others = found
    beside = _beside(bare, columns[1:])
    again = _of_equation(at.tested(beside, at.every(), SEED), first[0].equation)
    if not again or again[0].p_value >= level:
        found, columns = others, columns[1:]
    together = [evidence_together(bare, each) for each in columns]
    return [found[i] for i in np.argsort(-np.array(together), kind="stable")]


def evidence_together(bare: Nuisances, columns: Floats) -> float:
    """2 ln of the Bayes factor of an error of derivatives ``columns`` (K, c) against none."""
    gram = columns.T @ columns
    test = Projection.of(bare.at, bare.free, bare.prior).out_of(columns.copy())
    return float(evidence(test.score, test.information, NEGLIGIBLE * gram))


def _of_equation(errors: Sequence[Curve], equation: str) -> list[Curve]:
    return [curve for curve in errors if curve.equation == equation]


def _beside(bare: Nuisances, columns: Sequence[Floats]) -> Nuisances:
    return bare.also(np.column_stack(columns), WIDEST).explained()


def _columns(at: CurvesAt, errors: Sequence[Curve]) -> Floats:
    """Derivatives (K, c) by the curves of one equation, one over each of its leading covariates."""
    place = places(at.problem)
    leading = list({c.covariate: c for c in reversed(errors)}.values())
    leading = sorted(leading, key=lambda c: -c.evidence)[:COVARIATES]
    tables = [
        CandidateCurve(c.error_term, c.equation, place[c.error_term], c.covariate, c.at)
        for c in leading
    ]
    return np.column_stack([part for part, _ in at.derivatives(tables)])
