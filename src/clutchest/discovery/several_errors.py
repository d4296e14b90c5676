"""More than one error without a name: forward selection of equations, each established beside
curves in those before, and backward elimination of those that stood in for others.

What one wrong equation does shows in others too, and one curve there may be likelier than any one
in itself: an error goes with several covariates.  So equations are ranked by the likeliest sum of
their curves.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from clutchest.discovery.curve_evidence import evidence
from clutchest.discovery.nuisances import Nuisances
from clutchest.discovery.refitted_curves import Located, comes_and_goes
from clutchest.discovery.residual_curves import (
    Curve,
    CurvesAt,
)
from clutchest.inference.score_test import Projection
from clutchest.signals import Floats

MOST = 3  # equations
COVARIATES = 8  # of an equation: so many curves at most are joined to its error
WIDEST = 10.0  # standard deviation of these, in units of an error
SEED = 5
TIED = 6.0  # of 2 ln of the Bayes factor, 20: what lags by less is not excluded (Kass, Raftery)


class Errors(NamedTuple):
    """The equations that have an error, each by its curves, and those in which the first one's may
    be ``instead``, by name: nearly as likely."""

    found: list[list[Curve]]
    instead: list[str]


def several_errors(place: Located, free: NDArray[np.int64], level: float) -> Errors:
    """The equations that have an error, those whose sum of curves it is likeliest to be first: of
    those of the model without a cause, and others that are significant at a family-wise ``level``
    beside curves over all leading covariates of the rest; ``free`` unknowns (indices) beside all.
    Where curves are fitted in full, their order stays."""
    errors, objective, fit, fitted = place.errors, place.objective, place.fit, place.fitted
    at = CurvesAt.of(objective, fit)
    brief = at.problem.compiled.machine.durations
    every = [table for table in at.every() if not (fitted and comes_and_goes(table, brief))]
    bare = Nuisances(fit, free, objective.prior)
    by_equation = {c.equation: _of_equation(errors, c.equation) for c in errors}
    likely = {
        name: own[0].evidence if fitted else evidence_joined(bare, _columns(at, own)).evidence
        for name, own in by_equation.items()
    }
    ranked = sorted(likely, key=lambda name: -likely[name])
    found = [by_equation[ranked[0]]]
    columns = [_columns(at, found[0], place.first)]
    while len(found) < MOST:
        beside = _beside(bare, columns)
        known = {each[0].equation for each in found}
        left = [c for c in at.tested(beside, every, SEED) if c.equation not in known]
        if not left or left[0].p_value >= level:
            break
        found.append(_of_equation(left, left[0].equation))
        columns.append(_columns(at, found[-1]))
    joined = [evidence_joined(bare, each) for each in columns]
    first, *others = found
    # several others that explain less together than the first alone do not take its place
    if others and sum(each.evidence for each in joined[1:]) > likely[ranked[0]]:
        beside = _beside(bare, columns[1:])
        if fitted:
            p_value = float(np.exp(-evidence_joined(beside, columns[0]).evidence / 2.0))
        else:
            again = _of_equation(at.tested(beside, every, SEED), first[0].equation)
            p_value = again[0].p_value if again else 1.0
        if p_value >= level:
            found, joined = others, joined[1:]
    stays = int(fitted and found[0][0].equation == ranked[0])
    rest = sorted(range(stays, len(found)), key=lambda i: -joined[i].evidence)
    order = [*range(stays), *rest]
    found = [found[i] if fitted else _first(found[i], joined[i].which) for i in order]
    least = likely[found[0][0].equation] - TIED if found[0][0].equation == ranked[0] else np.inf
    known = {each[0].equation for each in found}
    return Errors(found, [n for n in ranked if likely[n] >= least and n not in known])


class Joined(NamedTuple):
    """2 ln of the Bayes factor of an error that is a sum of curves, and ``which`` these are."""

    evidence: float
    which: tuple[int, ...]


class CurveColumns(NamedTuple):
    """Derivatives ``by`` (K, c) the coefficients of a curve, of whose information ``negligible``
    (c, c) is no more than noise of its inputs."""

    by: Floats
    negligible: Floats


def evidence_joined(bare: Nuisances, curves: Sequence[CurveColumns]) -> Joined:
    """An error that is a sum of ``curves`` against none, joined one by one as long as each tells
    more than that it was one among them."""
    columns = np.column_stack([curve.by for curve in curves])
    ends = np.cumsum([curve.by.shape[1] for curve in curves])
    own = [np.arange(end - c.by.shape[1], end) for end, c in zip(ends, curves, strict=True)]
    test = Projection.of(bare.at, bare.free, bare.prior).out_of(columns)
    rare = 2.0 * np.log(len(curves))

    def joined(which: tuple[int, ...]) -> Joined:
        some = np.concatenate([own[i] for i in which])
        negligible = block_diag(*(curves[i].negligible for i in which))
        of = evidence(test.score[some], test.information[np.ix_(some, some)], negligible)
        return Joined(float(of) - rare * len(which), which)

    best = max(joined((i,)) for i in range(len(curves)))
    while len(best.which) < len(curves):
        left = [i for i in range(len(curves)) if i not in best.which]
        more = max(joined((*best.which, i)) for i in left)
        if more.evidence <= best.evidence:
            break
        best = more
    return best


def _first(errors: Sequence[Curve], which: Sequence[int]) -> list[Curve]:
    """The curves of an equation, those over ``which`` of its leading covariates first."""
    leading = _leading(errors)
    chosen = [leading[i] for i in which]
    return chosen + [curve for curve in errors if not any(curve is each for each in chosen)]


def _of_equation(errors: Sequence[Curve], equation: str) -> list[Curve]:
    return [curve for curve in errors if curve.equation == equation]


def _beside(bare: Nuisances, columns: Sequence[Sequence[CurveColumns]]) -> Nuisances:
    every = [curve.by for each in columns for curve in each]
    return bare.also(np.column_stack(every), WIDEST).explained()


def _leading(errors: Sequence[Curve]) -> list[Curve]:
    """The best curve over each leading covariate of one equation's."""
    best = {c.covariate: c for c in reversed(errors)}.values()
    return sorted(best, key=lambda c: -c.evidence)[:COVARIATES]


def _columns(
    at: CurvesAt, errors: Sequence[Curve], first: Floats | None = None
) -> list[CurveColumns]:
    """The curve of one equation over each of its leading covariates; that of the ``first`` one by
    its own derivatives (K, c) where it is fitted in full."""
    tables = [at.table(curve) for curve in _leading(errors)]
    found = [
        (table, part[:, own].copy()) for part, some in at.derivatives(tables) for table, own in some
    ]
    if first is not None:
        found = [(t, first if t is tables[0] else by) for t, by in found]
    pairs = zip(found, at.negligible(found), strict=True)
    return [CurveColumns(by, negligible) for (_, by), negligible in pairs]
