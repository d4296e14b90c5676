"""Curves fitted in full: an error that is large is another one to first order.

A clutch that bites elsewhere has another slope there, and what heats it less makes it bite less, so
that to first order the right curve may explain little, and one that can be anything is likelier.
Where errors are that large, the leading curves of every error term are fitted by Gauss–Newton steps
with the curve in the equations, over covariates as they are without it, and ranked by what they
explain there.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from clutchest.compute.records import Varying
from clutchest.discovery.curve_evidence import covariance, freedom, principal_deviations
from clutchest.discovery.residual_curves import (
    NEGLIGIBLE,
    CandidateCurve,
    Curve,
    CurvesAt,
    places,
    unlikelier,
)
from clutchest.discovery.search import Search
from clutchest.inference.concurrent_fits import concurrently
from clutchest.inference.covariates import FINE_KNOTS, hats
from clutchest.inference.innovations import NO_DERIVATIVES
from clutchest.inference.linearisation import Modulation
from clutchest.inference.map_fit import improve
from clutchest.inference.objective import Objective, runs_away
from clutchest.inference.score_test import Projected, Projection
from clutchest.inference.unknowns import UnknownGain
from clutchest.inference.white_linearisation import Linearisation
from clutchest.models.effects.effect import TIME
from clutchest.signals import Floats

LARGE = 50.0  # of a curve's worth: from here on, the first order is not exact
AS_LIKELY = 0.2  # of the leading evidence: terms that have less in full are left at that
LEADERS, DRIVERS = 4, 9  # curves that are fitted: of all, more of a term
FINEST = 3  # of an equation: more finely
FINE = 12  # knots of a curve that bends more closely, at least
WIDEST = 10.0  # standard deviation of coefficients, in units of an error
STEPS = 6  # at most
SHARES = (1.0, 0.5, 0.2, 0.05)  # of a step, until it pays
SETTLED = 1.0  # of −2 ln(probability): a step that gained less was the last

_Key = tuple[str, str, int]  # of a curve: its error term, what it goes with, its knots


class Located(NamedTuple):
    """``errors`` of a model without a cause, the most likely first, and where others beside the
    first are sought: an ``objective``, and its ``fit``, to first order without that one; where the
    leading ones are fitted in full, derivatives (K, c) by the coefficients of the ``first``."""

    errors: Sequence[Curve]
    objective: Objective
    fit: Linearisation
    first: Floats | None = None

    @property
    def fitted(self) -> bool:
        """Whether the leading errors are fitted in full."""
        return self.first is not None


@dataclass(frozen=True, slots=True)
class _Point:
    """A fit with a curve of these ``coefficients`` (c) in the equations of the ``objective``'s
    problem."""

    objective: Objective
    lin: Linearisation
    coefficients: Floats

    @property
    def cost(self) -> float:
        """As fits have it, and that of the coefficients in their prior."""
        return self.lin.cost + float(np.sum((self.coefficients / WIDEST) ** 2))


class _Fitted(NamedTuple):
    """A curve, as it is where it is fitted, the unknowns ``theta`` (m) there, and the fits from
    where it began.  Of an hour, a point with its derivatives takes 300 MiB, and many are compared:
    none is kept."""

    curve: Curve
    theta: Floats
    by: _Fits


@dataclass(frozen=True, slots=True, eq=False)
class _Fits:
    """Where fits of curves ``begin``: at a model without one, of covariates as they are there, with
    these ``free`` unknowns (indices); judged by what they explain more than the ``null``, and by
    how much ``unlikelier`` curves of each equation are than it is to be wrong."""

    begin: CurvesAt
    null: Linearisation
    free: NDArray[np.int64]
    unlikelier: Mapping[str, float]

    @classmethod
    def of(cls, search: Search) -> tuple[_Fits, _Fits]:
        """At the null of a search, and at the numbers of the vehicle's file: what makes up for a
        large error is far from the truth, where temperatures are none that there are."""
        objective, free = search.objective, search.free(())
        begin = objective.linearise_at(search.null.fit.theta, active=free)
        null = improve(objective, begin, free)
        stated = objective.linearise_at(np.zeros(len(null.theta)), active=free)
        begins = [CurvesAt.of(objective, at) for at in (null, stated)]
        less = unlikelier(begins[0].every())
        first, second = (cls(begin, null, free, less) for begin in begins)
        return first, second

    def from_none(self, curve: Curve) -> _Fitted:
        """A curve, fitted from none on."""
        begin, count = self.begin, len(curve.at)
        bends = begin.bends(curve.covariate, curve.error_term)
        at = next((at for at in bends if len(at) == count), curve.at)
        return self._fitted(
            replace(curve, at=at), _Point(begin.objective, begin.fit, np.zeros(count))
        )

    def finer(self, known: _Fitted) -> _Fitted:
        """A fitted curve with more knots, every piece in as many parts, from its fit on."""
        curve, pieces = known.curve, len(known.curve.at) - 1
        parts = pieces * -(-(FINE - 1) // pieces)
        bends = np.interp(np.linspace(0.0, pieces, parts + 1), np.arange(pieces + 1.0), curve.at)
        start = np.interp(bends, curve.at, curve.coefficients)  # the same curve
        at = replace(self.resumed(known), coefficients=start)
        return self._fitted(replace(curve, at=bends), at)

    def resumed(self, known: _Fitted) -> _Point:
        """Where a curve is fitted, with derivatives by what is free."""
        curve, begin = known.curve, self.begin
        theta, bases = places(begin.problem)[curve.error_term], self._bases(curve)
        objective = _with_curve(begin.objective, bases, theta, curve.coefficients)
        lin = objective.linearise_at(known.theta, begin.fit.shapes, self.free)
        return _Point(objective, lin, curve.coefficients)

    def derivatives(self, curve: Curve, at: _Point) -> Floats:
        """By the coefficients of a curve (K, c)."""
        columns = np.arange(len(curve.at))
        modulations = [Modulation(basis, columns) for basis in self._bases(curve)]
        thetas = np.full(len(columns), places(self.begin.problem)[curve.error_term])
        return at.objective.modulated(at.lin, thetas, modulations)

    def _fitted(self, curve: Curve, at: _Point) -> _Fitted:
        by, bases = self.derivatives(curve, at), self._bases(curve)
        # the noise that inputs bring along seems to depend on a curve where these are changed by it
        objective = at.objective.also_in_span(by)
        at = replace(at, objective=objective, lin=objective.judged(at.lin))
        theta = places(self.begin.problem)[curve.error_term]
        for _ in range(STEPS):
            there = self._along(at, self._step(at, by), bases, theta)
            if there is None or runs_away(other := self.derivatives(curve, there)):
                break
            gained, at, by = at.cost - there.cost, there, other
            if gained < SETTLED:
                break
        of, negligible = self._projected(at, by), NEGLIGIBLE * (by.T @ by)
        spread = covariance(of.information, negligible, WIDEST)
        explained = objective.judged(self.null).cost - at.lin.cost
        free = freedom(at.coefficients, of.information, negligible, WIDEST)
        known = replace(
            curve,
            coefficients=at.coefficients,
            off=principal_deviations(spread),
            worth=explained - 2.0 * float(np.trace(spread @ of.information)),
            evidence=(evidence := explained - free - self.unlikelier.get(curve.equation, 0.0)),
            # noise has a Bayes factor of B once in B times at most
            p_value=min(curve.p_value, float(np.exp(-max(evidence, 0.0) / 2.0))),
        )
        return _Fitted(known, at.lin.theta, self)

    def _bases(self, curve: Curve) -> list[Floats]:
        """A curve's hats (events, c) in every drive."""
        return [hats(values[curve.covariate], curve.at) for values in self.begin.values]

    def _projected(self, at: _Point, by: Floats) -> Projected:
        """What of derivatives (K, c) no other unknown explains; scores are those of no curve."""
        return Projection.of(without(at, by), self.free, at.objective.prior).out_of(by.copy())

    def _step(self, at: _Point, by: Floats) -> tuple[Floats, Floats]:
        """A step of all unknowns (m) and of the coefficients (c)."""
        of, negligible = self._projected(at, by), NEGLIGIBLE * (by.T @ by)
        change = covariance(of.information, negligible, WIDEST) @ of.score - at.coefficients
        psi, prior = at.lin.by(self.free), at.objective.prior[self.free]
        inner = psi.T @ psi + np.diag(prior + 1e-9)
        down = psi.T @ (at.lin.r + by @ change) + prior * at.lin.theta[self.free]
        move = np.zeros(len(at.lin.theta))
        move[self.free] = -np.linalg.solve(inner, down)
        return move, change

    @np.errstate(over="ignore", invalid="ignore")  # of a step too far
    def _along(
        self, at: _Point, move: tuple[Floats, Floats], bases: Sequence[Floats], theta: int
    ) -> _Point | None:
        """The first part of a step that pays."""
        by_theta, by_curve = move
        for share in SHARES:
            coefficients = at.coefficients + share * by_curve
            objective = _with_curve(at.objective, bases, theta, coefficients)
            numbers = objective.within_bounds(at.lin.theta + share * by_theta, self.free)
            lin = objective.relinearise(at.lin, numbers, active=NO_DERIVATIVES)
            if _Point(objective, lin, coefficients).cost < at.cost:
                lin = objective.relinearise(at.lin, numbers, active=self.free)
                if np.isfinite(lin.cost):
                    return _Point(objective, lin, coefficients)
        return None


def without(at: _Point, by: Floats) -> Linearisation:
    """A fit without its curve, to first order, ``by`` (K, c) the curve's derivatives."""
    return replace(at.lin, r=at.lin.r - by @ at.coefficients)


def _with_curve(
    objective: Objective, bases: Sequence[Floats], theta: int, coefficients: Floats
) -> Objective:
    """The objective of the same problem in whose equations a curve acts by the error term
    ``theta`` (index)."""
    problem = objective.problem
    unknown = problem.thetas[theta]
    assert isinstance(unknown, UnknownGain)
    numbers = [(effect.name, key) for effect, key in problem.compiled.model.numbers]
    row = np.array([numbers.index((unknown.effect, unknown.key))])
    drives = tuple(
        replace(drive, varying=Varying(row, unknown.unit * (basis @ coefficients)[:, None]))
        for drive, basis in zip(problem.drives, bases, strict=True)
    )
    return replace(objective, problem=replace(problem, drives=drives))


def comes_and_goes(curve: Curve | CandidateCurve, brief: Container[str]) -> bool:
    """Whether an error does within seconds: over time, or over one of the ``brief`` durations."""
    return curve.covariate in brief or (
        curve.covariate == TIME and len(curve.at) == max(FINE_KNOTS)
    )


def located(search: Search, errors: Sequence[Curve], explained: float = 0.0) -> Located:
    """The ``errors`` of a search's model without a cause; where they are large, or causes have
    ``explained`` much, 2 Δ ln L, the leading ones as fitted in full before all others, and others
    beside the first are sought where that is."""
    theta, shapes = search.null.fit.theta, search.null.fit.shapes
    # no equation lets an error come and go within seconds for the sake of being fitted: over time,
    # or after each beginning, it stands for any part that is slow or late
    brief = search.problem.compiled.machine.durations
    steady = [curve for curve in errors if curve.covariate not in brief]
    some = [curve for curve in steady if not comes_and_goes(curve, brief)]
    if not some or max(explained, *(curve.worth for curve in some)) < LARGE:
        return Located(errors, search.objective, search.objective.white_at(theta, shapes))
    leading = _fitted_in_full(search, some)
    done = {_key(each.curve) for each in leading}
    last = leading[-1].curve.evidence
    others = [
        replace(curve, evidence=min(curve.evidence, last))
        for curve in steady
        if _key(curve) not in done
    ]
    best, _, fits = leading[0]
    at = fits.resumed(leading[0])
    by = fits.derivatives(best, at)
    objective = at.objective.also_in_span(by)
    full = replace(objective.relinearise(at.lin, at.lin.theta), raw=())
    fit = without(replace(at, lin=full), by)
    return Located([*(each.curve for each in leading), *others], objective, fit, by)


def _fitted_in_full(search: Search, some: Sequence[Curve]) -> list[_Fitted]:
    """Of errors by first order, ``some``, those that may lead, each from none on, the likeliest
    first."""
    starts = _Fits.of(search)
    # what explains most to first order may not do so in full, nor the right error anything
    least = AS_LIKELY * some[0].evidence
    firsts = {curve.error_term: curve for curve in reversed(some)}.values()
    leaders = [
        (fits, curve)
        for curve in {_key(c): c for c in (*some[:LEADERS], *firsts)}.values()
        for fits in starts[: 2 if curve.evidence > least else 1]
    ]
    done = _likeliest(_from_none(search, leaders))
    of_terms = {each.curve.error_term: each for each in reversed(_sorted(done.values()))}
    likely = AS_LIKELY * max(map(_evidence, of_terms.values()))
    followers = [
        (leader.by, curve)
        for term, leader in of_terms.items()
        if _evidence(leader) > likely
        for curve in [c for c in some if c.error_term == term and _key(c) not in done][:DRIVERS]
    ]
    done = _likeliest([*done.values(), *_from_none(search, followers)])
    # the start from which the leader of a term became the likeliest may lead another curve nowhere
    known = {(fits, _key(curve)) for fits, curve in (*leaders, *followers)}
    others = [
        (fits, each.curve)
        for each in _finest(_sorted(done.values()))
        for fits in starts
        if (fits, _key(each.curve)) not in known
    ]
    done = _likeliest([*done.values(), *_from_none(search, others)])
    # where data are precise, five straight pieces of the true curve are none
    coarse = [
        each
        for each in _finest(_sorted(done.values()))
        if len(each.curve.at) < FINE and each.curve.covariate != TIME
    ]
    count = len(search.free(())) + FINE
    finer = concurrently(search.problem, count, lambda each: each.by.finer(each), coarse)
    return _sorted([*done.values(), *finer])


def _from_none(search: Search, wanted: Sequence[tuple[_Fits, Curve]]) -> list[_Fitted]:
    """Curves, each by the fits beside it, from none on."""
    count = len(search.free(())) + FINE
    return concurrently(search.problem, count, lambda each: each[0].from_none(each[1]), wanted)


def _likeliest(fitted: Iterable[_Fitted]) -> dict[_Key, _Fitted]:
    """The likeliest fit of every curve."""
    return {_key(each.curve): each for each in reversed(_sorted(fitted))}


def _sorted(fitted: Iterable[_Fitted]) -> list[_Fitted]:
    """The likeliest first."""
    return sorted(fitted, key=_evidence, reverse=True)


def _finest(leading: Sequence[_Fitted]) -> list[_Fitted]:
    """Of curves in the order of their evidence the first few of each equation that is likely."""
    likely = [e for e in leading if _evidence(e) > AS_LIKELY * _evidence(leading[0])]
    equations = dict.fromkeys(each.curve.equation for each in likely)
    return [
        each
        for equation in equations
        for each in [e for e in likely if e.curve.equation == equation][:FINEST]
    ]


def _evidence(known: _Fitted) -> float:
    return known.curve.evidence


def _key(curve: Curve) -> _Key:
    return curve.error_term, curve.covariate, len(curve.at)
