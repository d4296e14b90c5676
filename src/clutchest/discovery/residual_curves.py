"""Errors that no named cause explains: a free curve over one covariate in one equation.

Each curve is judged by its Bayes factor: its coefficients have a prior of one size for all, which
may be any of SCALES, and equations are equally likely to be wrong, whatever number of curves each
has.  The null distribution of the factor is drawn.  Over time, a curve stands for process
noise in the equation.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from clutchest.discovery.curve_evidence import covariance, evidence, expected
from clutchest.discovery.curve_portions import held, portions
from clutchest.discovery.noise_blocks import noise_blocks
from clutchest.discovery.nuisances import Nuisances
from clutchest.inference.cores import cores, shared
from clutchest.inference.covariates import (
    FINE_KNOTS,
    at_rest,
    covariates,
    hats,
    knots,
    measured_at_rest,
    noise_in_derivatives,
)
from clutchest.inference.estimated_noise import INSIGNIFICANT, LONGEST, EstimatedNoise
from clutchest.inference.linearisation import Modulation
from clutchest.inference.objective import Objective
from clutchest.inference.problem import Problem
from clutchest.inference.score_test import Projected, Projection, family_wise, resampled_scores
from clutchest.inference.unknowns import UnknownGain
from clutchest.inference.white_linearisation import Linearisation
from clutchest.memory import give_back
from clutchest.models.declarations import RECENT_SLIP
from clutchest.models.error_term_effects import PREFIX
from clutchest.models.error_terms import ErrorTerm
from clutchest.signals import Floats

DRAWS = 1000
NEGLIGIBLE = 3e-7  # of a curve, squared: a smaller remainder is no more than its inputs' noise
CLEAR = 100.0  # times the power of a curve's noise, from which on a remainder is a curve
REGULATED = 0.2  # of its size: a covariate that moves less is held there


@dataclass(frozen=True, slots=True)
class Curve:
    """An error of ``equation``, in the way of ``error_term``, as a curve over ``covariate``.

    ``at`` its knots (c), ``coefficients`` (c) the expected ones (units of the error term); ``off``
    (c, c) in rows their principal deviations, one standard deviation each; ``worth`` how much
    they improve the fit under a prior of one unit, 2 Δ ln L, less what noise alone does.
    ``evidence`` 2 ln of the Bayes factor against no such error, ``p_value`` family-wise, over all
    curves.
    """

    error_term: str
    equation: str
    covariate: str
    at: Floats
    coefficients: Floats
    off: Floats
    worth: float
    evidence: float
    p_value: float


class CandidateCurve(NamedTuple):
    """A curve to be tested: coefficients at knots ``at`` (c) of a ``covariate``, by which the
    unknown ``theta`` (index) acts, in units of ``unit`` of it; of the curve, squared, less than a
    share ``negligible`` is no more than noise of its inputs."""

    term: str
    equation: str
    theta: int
    covariate: str
    at: Floats
    unit: float = 1.0
    negligible: float = NEGLIGIBLE


def curves(
    objective: Objective,
    fit: Linearisation,
    beside: Nuisances,
    seed: int,
    equations: Collection[str] = (),
) -> list[Curve]:
    """Every curve over every covariate at a fit, the most likely first, ``beside`` what is free; in
    these ``equations`` alone where some are given."""
    at = CurvesAt.of(objective, fit)
    some = [t for t in at.every() if not equations or t.equation in equations]
    return at.tested(beside, some, seed)


@dataclass(frozen=True, slots=True)
class CurvesAt:
    """Curves at a ``fit`` of an ``objective``, over covariates of which every drive has these
    ``values`` there, some without the ``noise`` that derivatives hold."""

    objective: Objective
    fit: Linearisation
    values: Sequence[Mapping[str, Floats]]
    noise: Sequence[Mapping[str, Floats]]

    @classmethod
    def of(cls, objective: Objective, fit: Linearisation) -> CurvesAt:
        """With every covariate of every drive."""
        implied = zip(objective.problem.drives, fit.implied, strict=True)
        drives = [(drive, measured_at_rest(drive, at)) for drive, at in implied]
        values = [covariates(*each) for each in drives]
        smooth = zip(drives, values, strict=True)
        noise = [noise_in_derivatives(*each, without) for each, without in smooth]
        return cls(objective, fit, values, noise)

    @property
    def problem(self) -> Problem:
        """The drives and their unknowns."""
        return self.objective.problem

    def varying(self) -> list[str]:
        """Names of the covariates that every drive has, and that vary in one; slopes of readings,
        which hold their noise, and slip of late only where an error term lists them."""
        drives = zip(self.problem.drives, self.fit.implied, strict=True)
        still = set.intersection(*(at_rest(*each) for each in drives))
        terms = self.problem.compiled.machine.error_terms.values()
        asked = {*self.problem.compiled.model.slopes, RECENT_SLIP}
        still |= asked.difference(*(t.covariates for t in terms))
        first = self.values[0]
        return [n for n in first if n not in still and all(n in v for v in self.values)]

    def every(self) -> list[CandidateCurve]:
        """Every curve over every covariate, by every error term."""
        place = places(self.problem)
        terms = self.problem.compiled.machine.error_terms
        terms = {k: v for k, v in terms.items() if k in place}  # not all without a signal
        return [
            CandidateCurve(term, terms[term].equation, place[term], covariate, at)
            for covariate in self.varying()
            for read, some in self._by_readings(terms).items()
            for at in self._bends(covariate, read)
            if not self._regulated(covariate, at)
            for term in some
            if _is_tested(terms[term], covariate, at)
        ]

    def bends(self, covariate: str, term: str = "") -> tuple[Floats, ...]:
        """Where curves over a covariate may bend, by where errors act; those of an error ``term``
        that changes a reading, also by where it is read."""
        compiled = self.problem.compiled
        own = compiled.machine.error_terms.get(term)
        return self._bends(covariate, own.readings(compiled.model.sensors) if own else ())

    def _by_readings(self, terms: Mapping[str, ErrorTerm]) -> dict[tuple[int, ...], list[str]]:
        """Sensors (indices) whose readings error terms change → names of these terms."""
        sensors, found = self.problem.compiled.model.sensors, dict[tuple[int, ...], list[str]]()
        for name, term in terms.items():
            found.setdefault(term.readings(sensors), []).append(name)
        return found

    def _bends(self, covariate: str, read: tuple[int, ...]) -> tuple[Floats, ...]:
        """By where errors act; as far as where sensors (indices) are ``read``."""
        drives = self.problem.drives
        acts = np.concatenate([d.tracked.act for d in drives]).astype(float)
        values = np.concatenate([v[covariate] for v in self.values])
        acts = acts if acts.any() else np.ones(len(acts))
        reads = np.concatenate([np.isin(d.line.sensor, read) for d in drives])
        return knots(self.problem.compiled.machine, covariate, values, acts, reads)

    def _regulated(self, covariate: str, at: Floats) -> bool:
        """Whether a covariate with knots ``at`` is held at one value: it still moves by what a loop
        has not yet put right, errors of the model among that.  Where a scale of °C or of a reading
        in mm begins says nothing."""
        model, peaks = self.problem.compiled.model, self.problem.compiled.machine.peaks
        from_anywhere = {s.name for s in model.states if s.unit == "°C"}
        from_anywhere |= {i.name for i in model.inputs if i.unit in ("°C", "mm")}
        if peaks.get(covariate, covariate) in from_anywhere:
            return False
        return float(np.ptp(at)) < REGULATED * float(np.abs(at).max())

    def derivatives(
        self, tables: Sequence[CandidateCurve]
    ) -> Iterator[tuple[Floats, list[tuple[CandidateCurve, slice]]]]:
        """Derivatives (K, C) of the white innovations by every coefficient of the curves, and
        columns of each curve; some covariates at a time, as many as memory holds."""
        for some in portions(tables, held(self.fit)):
            yield self._portion(some, self._basis)

    def table(self, curve: Curve) -> CandidateCurve:
        """A known curve as one to be tested."""
        place = places(self.problem)[curve.error_term]
        return CandidateCurve(curve.error_term, curve.equation, place, curve.covariate, curve.at)

    def by_coefficients(self, curve: Curve) -> Floats:
        """Derivatives (K, c) of the white innovations by the coefficients of a known curve."""
        ((derivatives, _),) = self.derivatives([self.table(curve)])
        return derivatives

    def tested(self, beside: Nuisances, tables: Sequence[CandidateCurve], seed: int) -> list[Curve]:
        """The curves ``tables``, the most likely first, ``beside`` what else is free.  Where the
        record is short and one is significant, their null is that of noise whose colour is
        estimated."""
        give_back()  # of an hour, what is free in between is 100 MiB
        found = self._tested(beside, tables, seed, None)
        least = min((curve.p_value for curve in found), default=1)
        if len(self.fit.r) > LONGEST or least > INSIGNIFICANT:
            return found
        noise = EstimatedNoise(self.objective.noise_model, self.objective.stretches)
        return self._tested(beside, tables, seed, noise)

    def negligible(self, some: Sequence[tuple[CandidateCurve, Floats]]) -> list[Floats]:
        """What of the information (c, c) of each curve is no more than noise of its inputs, by its
        derivatives (K, c)."""
        noise = self._by_noise([table for table, _ in some])
        return [
            np.asarray(table.negligible * (by.T @ by) + CLEAR * (off.T @ off))
            for (table, by), off in zip(some, noise, strict=True)
        ]

    def _by_noise(self, tables: Sequence[CandidateCurve]) -> list[Floats]:
        """Derivatives (K, c) by what each curve would be with the noise that its covariate lacks,
        less what it is.  A parameter by which the model has a straight curve holds that noise,
        which is in the innovations as well: what is left of the two beside each other is no error.
        No rows where it lacks none."""
        lacks = [all(table.covariate in noise for noise in self.noise) for table in tables]
        lacking = [table for table, lack in zip(tables, lacks, strict=True) if lack]
        if not lacking:
            return [np.zeros((0, len(table.at))) for table in tables]

        def off(k: int, table: CandidateCurve) -> Floats:
            value, noise = self.values[k][table.covariate], self.noise[k][table.covariate]
            return hats(value + noise, table.at) - hats(value, table.at)

        derivatives, each = self._portion(lacking, off)
        found = iter(each)
        return [
            derivatives[:, next(found)[1]] if lack else np.zeros((0, len(table.at)))
            for table, lack in zip(tables, lacks, strict=True)
        ]

    def _basis(self, k: int, table: CandidateCurve) -> Floats:
        """A curve's hats (events, c) in a drive (index)."""
        return hats(self.values[k][table.covariate], table.at)

    def _tested(
        self,
        beside: Nuisances,
        tables: Sequence[CandidateCurve],
        seed: int,
        noise: EstimatedNoise | None,
    ) -> list[Curve]:
        """The same, by the null of a ``noise`` whose colour is estimated, or by a known one."""
        less = unlikelier(tables)
        blocks = noise_blocks(self.problem)
        projection = Projection.of(beside.at, beside.free, beside.prior)

        def null(derivatives: Floats, c: Projected) -> Floats:
            """Scores (draws, C) by these ``derivatives`` (K, C), of which ``c`` is left."""
            rng = np.random.default_rng(seed)  # every portion meets the same draws of noise
            if noise is not None:
                std = np.sqrt(np.diag(c.information))
                return noise.scores(projection, derivatives, self.fit.psi, rng) * std
            from_priors = rng.standard_normal((DRAWS, len(c.away))) @ c.away
            return from_priors + resampled_scores(projection.r, c.pure, DRAWS, rng)

        def judged(portion: list[CandidateCurve]) -> tuple[list[Curve], Floats]:
            give_back()
            derivatives, some = self._portion(portion, self._basis)
            negligible = self.negligible([(t, derivatives[:, columns]) for t, columns in some])
            c = projection.out_of(derivatives.copy() if noise else derivatives)
            return _judged(projection.r, c, null(derivatives, c), negligible, blocks, less, some)

        done = shared(judged, portions(tables, held(self.fit) // cores()))
        most = np.max([strongest for _, strongest in done] or [np.full(DRAWS, -np.inf)], axis=0)
        # noise has a Bayes factor of B once in B times at most
        least = np.sort(np.exp(-most / 2.0))
        named = [
            replace(curve, p_value=float(family_wise(least, np.exp(-curve.evidence / 2.0))))
            for results, _ in done
            for curve in results
        ]
        return sorted(named, key=lambda curve: -curve.evidence)

    def _portion(
        self, some: Sequence[CandidateCurve], basis: Callable[[int, CandidateCurve], Floats]
    ) -> tuple[Floats, list[tuple[CandidateCurve, slice]]]:
        """Derivatives by some curves of this ``basis`` (events, c) in a drive (index), and columns
        of each."""
        begins: dict[tuple[str, bytes], int] = {}
        bases: list[list[Floats]] = [[] for _ in self.values]
        for table in some:
            covariate, at = table.covariate, table.at
            if (covariate, at.tobytes()) not in begins:
                begins[covariate, at.tobytes()] = sum(each.shape[1] for each in bases[0])
                for k, known in enumerate(bases):
                    known.append(basis(k, table))
        counts = [len(table.at) for table in some]
        columns = np.concatenate(
            [begins[t.covariate, t.at.tobytes()] + np.arange(len(t.at)) for t in some]
        )
        thetas = np.repeat([table.theta for table in some], counts)

        def modulations() -> Iterator[Modulation]:
            """One drive's at a time: room for the derivatives."""
            while bases:
                yield Modulation(np.column_stack(bases.pop(0)), columns)

        derivatives = self.objective.modulated(self.fit, thetas, modulations())
        derivatives *= np.repeat([table.unit for table in some], counts)
        ends = np.cumsum(counts)
        own = zip(some, ends, strict=True)
        return derivatives, [(t, slice(end - len(t.at), end)) for t, end in own]


def _judged(
    r: Floats,
    c: Projected,
    null: Floats,
    negligible: Sequence[Floats],
    blocks: NDArray[np.int64],
    less: Mapping[str, float],
    some: Sequence[tuple[CandidateCurve, slice]],
) -> tuple[list[Curve], Floats]:
    """Curves by what is left of their derivatives ``c`` (K, C), in which for each of ``some`` less
    than ``negligible`` (c, c) is noise of its inputs, p-values not known yet, and the strongest
    evidence of each draw of ``null`` scores (draws, C)."""
    results, most = [], np.full(len(null), -np.inf)
    for (table, columns), least in zip(some, negligible, strict=True):
        information, score = c.information[columns, columns], c.score[columns]
        if np.trace(covariance(information, 0.0 * least) @ information) < 0.1:
            continue
        spread = covariance(information, least)
        rank = float(np.trace(spread @ information))
        most = np.maximum(
            most, evidence(null[:, columns], information, least) - less[table.equation]
        )
        best, dispersion = spread @ score, 1.0
        if evidence(score, information, least) > 0.0:
            pure = c.pure[:, columns]
            dispersion = _dispersion(pure, r + pure @ best, blocks, spread, rank)
        scaled = score / dispersion, information / dispersion, least / dispersion
        coefficients, off = expected(*scaled)
        results.append(
            Curve(
                table.term,
                table.equation,
                table.covariate,
                table.at,
                table.unit * coefficients,
                table.unit * off,
                float(score @ best) / dispersion - 2.0 * rank,
                float(evidence(*scaled)) - less[table.equation],
                1.0,
            )
        )
    return results, most


def _dispersion(
    pure: Floats, rest: Floats, blocks: NDArray[np.int64], spread: Floats, rank: float
) -> float:
    """How much more the scores of ``pure`` (K, c) scatter from block to block than noise at its
    mean level makes them: where inputs move fast, their noise and timing weigh more."""
    each = np.zeros((int(blocks.max()) + 1, pure.shape[1]))
    np.add.at(each, blocks, pure * rest[:, None])
    return max(1.0, float(np.trace(spread @ (each.T @ each))) / rank)


def unlikelier(tables: Iterable[CandidateCurve]) -> dict[str, float]:
    """By how much less likely a curve is than its equation is to be wrong, as one of all that this
    equation has: equation → 2 ln of their number."""
    return {k: 2.0 * float(np.log(n)) for k, n in Counter(t.equation for t in tables).items()}


def places(problem: Problem) -> dict[str, int]:
    """Index of every error term in θ."""
    return {
        t.effect.removeprefix(PREFIX): k
        for k, t in enumerate(problem.thetas)
        if isinstance(t, UnknownGain)
    }


def _is_tested(error_term: ErrorTerm, covariate: str, at: Floats) -> bool:
    """Whether a curve over ``covariate`` with these knots is tested."""
    quick = len(at) == max(FINE_KNOTS)
    return (not error_term.covariates or covariate in error_term.covariates) and not (
        error_term.slow and quick
    )
