"""The search: which causes, alone or together, the data require.

A search is a value: each step takes one and gives the next.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from clutchest.discovery.candidate_scores import columns, scored, spanned
from clutchest.discovery.candidates import CandidateCause, candidates, settings
from clutchest.discovery.cause_set import CauseSet, cost_of
from clutchest.inference.between_drives import unlike
from clutchest.inference.concurrent_fits import concurrently
from clutchest.inference.continuation import continue_towards_prior
from clutchest.inference.innovations import NO_DERIVATIVES
from clutchest.inference.map_fit import improve, settle, without
from clutchest.inference.objective import Objective
from clutchest.inference.problem import Problem
from clutchest.inference.score_test import ABSENT, NOT_EXCLUDED, Projection, ScoreTest
from clutchest.inference.sensor_ends import settled_off_ends
from clutchest.inference.unknowns import InitialState, Shapes
from clutchest.inference.white_linearisation import Linearisation
from clutchest.memory import give_back
from clutchest.progress import Progress
from clutchest.signals import Floats

# Family-wise false-alarm probability where the vehicle is its model.  Of 223 healthy trucks that
# are not, in one respect each, five had a cause, at p from 0.001 to 0.006.
LEVEL = 0.004
LEADERS, PARENTS = 8, 3  # fitted in full: causes alone, and causes to which another may join
MOST = 3  # causes acting together
CERTAIN = 1e-4  # family-wise p-value of a cause that is beyond doubt
CLOSE = 10.0  # of 2 Δ ln L: by how much a cause may lag by first order to be fitted
STRONG = 2.0 * CLOSE  # of a score, squared: from here on, the first order is not exact
INEXACT = 2e-4  # of what causes explain: equations that are 1 % off leave as much of it
WALL = 30.0  # times the best cost: where one begins beyond, it leads nowhere
RELEASED = 1.25  # of its largest plausible size: the bound of an established gain
UNUSUAL, LOOSE = 3.0, 3.0  # standard deviations of the state at rest: further off, the log begins
# in the middle of a drive, and the standard deviation of its start is so many times larger


@dataclass(frozen=True, slots=True)
class Search:
    """The state of a search over one problem.

    ``null`` the model without a cause, ``null_scores`` the scores of all candidates beside it;
    ``best`` the causes identified (none at first), ``rivals`` sets of as many, best first;
    ``p_values`` by effect: family-wise, of its score when it was first tried; ``tried`` what has
    been fitted; ``by_count`` the best and its rivals at every number of causes.
    ``begins``: of causes alone, by how much each improves the fit with a noise model of its own, 2
    Δ ln L, and that fit, from which those of a search begin as well.
    ``unusual_starts``: indices of temperatures from which drives start, unlike a clutch at rest.
    """

    objective: Objective
    candidates: tuple[CandidateCause, ...]
    null: CauseSet
    null_scores: ScoreTest
    best: CauseSet
    unusual_starts: NDArray[np.int64]
    rivals: tuple[CauseSet, ...] = ()
    p_values: Mapping[str, float] = field(default_factory=dict)
    tried: frozenset[frozenset[CandidateCause]] = frozenset()
    by_count: Mapping[int, tuple[CauseSet, ...]] = field(default_factory=dict)
    begins: Mapping[CandidateCause, tuple[float, Linearisation]] = field(default_factory=dict)

    @property
    def problem(self) -> Problem:
        """The drives and their unknowns."""
        return self.objective.problem

    @property
    def tied(self) -> list[CauseSet]:
        """Rivals that the data do not exclude."""
        return [
            h
            for h in self.rivals
            if h.cost - self.best.cost < NOT_EXCLUDED and h.names != self.best.names
        ]

    @property
    def clear(self) -> bool:
        """Whether some cause is significant beyond doubt, to first order."""
        return self.null_scores.least_p < CERTAIN

    def free(self, causes: Iterable[CandidateCause]) -> NDArray[np.int64]:
        """Indices of nuisances and of the gains of ``causes``."""
        return free_of(self.problem, causes)

    def fitted(self, causes: tuple[CandidateCause, ...], begin: Linearisation) -> CauseSet:
        """These causes, most probable sizes, from ``begin`` on."""
        return self.continued(self.fitted_near(causes, begin))

    def fitted_near(self, causes: tuple[CandidateCause, ...], begin: Linearisation) -> CauseSet:
        """The same in the mode in which ``begin`` lies, which a neighbour has found."""
        free, shapes = self.free(causes), settings(causes)
        theta = self._dropped(np.setdiff1d(self.problem.gains, free), free, shapes, begin)
        there = self.objective.linearise_at(theta, shapes, free)
        return CauseSet(causes, improve(self.objective, there, free, derivatives=False))

    def _dropped(
        self, gains: NDArray[np.int64], free: NDArray[np.int64], shapes: Shapes, at: Linearisation
    ) -> Floats:
        """``theta`` (m) of a fit with these ``gains`` (indices) at 0, and the ``free`` ones where
        they are, or where they are then to first order: where numbers are known precisely, what a
        cause had led astray is far up a wall without it."""
        theta, objective = at.theta.copy(), self.objective
        gains = gains[theta[gains] != 0.0]
        if not len(gains):
            return theta
        lin = objective.linearise_at(at.theta, at.shapes, np.append(free, gains))
        theta[gains] = 0.0
        return self.lowest((theta, without(objective, lin, free, gains)), shapes)

    def lowest(self, places: Sequence[Floats], shapes: Shapes) -> Floats:
        """That of some ``theta`` (m) at which the cost is lowest."""
        at = self.objective.linearise_at
        costs = [at(theta, shapes, NO_DERIVATIVES).cost for theta in places]
        return places[int(np.argmin(np.nan_to_num(costs, nan=np.inf)))]

    def likeliest(
        self, causes: tuple[CandidateCause, ...], begins: Sequence[Linearisation]
    ) -> CauseSet:
        """The best of the fits of these causes from all ``begins`` on, bare."""
        near = min((self.fitted_near(causes, begin) for begin in begins), key=cost_of)
        return self.continued(near).bare

    def continued(self, h: CauseSet) -> CauseSet:
        """A set of causes with its numbers led towards their priors where that is better."""
        free, known = self.free(h.causes), self.null.fit.theta
        nearer = continue_towards_prior(self.objective, h.fit, free, known)
        return h if nearer is h.fit else CauseSet(h.causes, nearer)

    def released(self, h: CauseSet) -> CauseSet:
        """A cause set with a fit that has innovations, and sizes that may exceed plausible ones:
        plausibility decides which causes there are, the data their sizes."""
        objective, free = self.objective, self.free(h.causes)
        fit = objective.innovations_at(h.fit.theta, h.fit.shapes)
        gains = [c.index for c in h.causes]
        sizes = fit.theta[gains]
        if np.any((sizes <= objective.low[gains]) | (sizes >= objective.high[gains])):
            fit = improve(objective.with_bounds(RELEASED), fit, free, derivatives=False)
        return replace(h, fit=fit.without_derivatives)

    def without(self, cause: CandidateCause, of: CauseSet) -> CauseSet:
        """A cause set less one of its causes."""
        return self.fitted(tuple(c for c in of.causes if c is not cause), of.fit)

    def scores(self, base: CauseSet, wanted: Sequence[CandidateCause], seed: int) -> ScoreTest:
        """Scores of ``wanted`` beside the causes in ``base``."""
        fit = self.objective.white_at(base.fit.theta, base.fit.shapes)
        derivatives = columns(self.objective, fit, wanted)
        return scored(self.objective, fit, self.free(base.causes), wanted, derivatives, seed)

    def established(self, cause: CandidateCause, of: CauseSet) -> tuple[float, float]:
        """By how much a cause of a set improves the fit beside the others, 2 Δ ln L, and its
        family-wise p-value."""
        if len(of.causes) == 1:
            return self.null.cost - of.cost, self.p_values.get(cause.name, 0.0)
        improvement = self.released(self.without(cause, of)).cost - of.cost
        return improvement, self.p_of_improvement(cause, improvement)

    def p_of_improvement(self, cause: CandidateCause, improvement: float) -> float:
        """Family-wise p-value of a cause that improves the fit by so much, 2 Δ ln L."""
        sides = 1.0 if cause.gain.one_sided else 2.0
        p = sides * ndtr(-np.sqrt(max(improvement, 0.0)))
        return float(self.null_scores.p_family_wise(p))

    def least_gain(self, beside: CauseSet | None = None) -> float:
        """By how much, in 2 Δ ln L, one more cause must improve the fit; ``beside`` others by more
        than what may be left of them because equations are not exact."""
        more_than_noise = float(np.min(self.null_scores.threshold(LEVEL))) ** 2
        explained = self.null.cost - beside.cost if beside else 0.0
        return max(more_than_noise, INEXACT * explained)

    def margin(self, than: CauseSet | None = None) -> float:
        """By how much the best improves the fit, 2 Δ ln L, beyond what it must to be identified and
        not one ``than`` it with fewer causes (none unless given)."""
        than = than or self.null
        more = len(self.best.causes) - len(than.causes)
        return than.cost - self.best.cost - more * self.least_gain()

    def reduced_to(self, fewer: CauseSet) -> Search:
        """To a set of fewer causes, or to one of as many that was tried and is more likely."""
        count = len(fewer.causes)
        ranked = sorted([fewer, *self.by_count[count]], key=cost_of)
        names = [h.names for h in ranked]
        best, *rivals = (h for i, h in enumerate(ranked) if h.names not in names[:i])
        by_count = {**self.by_count, count: (best, *rivals)}
        return replace(self, best=best, rivals=tuple(rivals), by_count=by_count)

    def restarted_at(self, there: CauseSet) -> Search:
        """From a set at other values of the unknowns, or from a rival of as many causes that is
        better there."""
        count = len(there.causes)
        rivals = [
            self.fitted(h.causes, there.fit).bare
            for h in self.by_count.get(count, ())
            if h.names != there.names
        ]
        best, *others = sorted([there, *rivals], key=cost_of)
        by_count = {**self.by_count, count: (best, *others)}
        moved = replace(self, best=best, rivals=tuple(others), by_count=by_count, tried=frozenset())
        if count:
            return moved
        scores = moved.scores(there, self.candidates, seed=1)
        return replace(moved, null=there.bare, best=there.bare, null_scores=scores)


def begin(problem: Problem, progress: Progress | None = None) -> Search:
    """The model without a cause, fitted to its priors, and the score of every candidate."""
    if progress:
        progress("fitting the model without a cause", None)
    objective, fit = settled_off_ends(problem)
    problem = objective.problem
    unusual = _unusual_starts(problem, fit.theta)
    if len(unusual):
        objective, fit = settle(objective.with_prior(unusual, LOOSE), fit.theta)
    fit = fit.as_point
    give_back()
    fit, every = replace(objective.relinearise(fit, fit.theta), raw=()), candidates(problem)
    derivatives = columns(objective, fit, every)
    objective = objective.with_span([fit.psi, derivatives])
    fit = objective.judged(fit)
    scores = scored(objective, fit, free_of(problem, ()), every, derivatives, seed=1)
    null = CauseSet((), fit).bare
    del fit, derivatives
    give_back()
    return Search(objective, every, null, scores, null, unusual)


def run(search: Search, progress: Progress | None = None) -> Search:
    """Causes joined one by one as long as each improves the fit enough."""
    while len(search.best.causes) < MOST:
        count = len(search.best.causes)
        if progress:
            progress(f"trying {count + 1} cause{'s' if count else ''}", count / MOST)
        search, grown = _grown(search, [search.best, *search.rivals][:PARENTS])
        if grown and not count:
            search, grown = with_noise_of_best(search, grown)
        least = search.least_gain(search.best)
        if not grown or search.best.cost - min(h.cost for h in grown) < least:
            break
        best, *rivals = ranked = tuple(sorted(grown, key=cost_of))
        by_count = {**search.by_count, count + 1: ranked}
        search = replace(search, best=best, rivals=tuple(rivals), by_count=by_count)
        if (fewer := _superfluous(search)) is not None:
            search = search.reduced_to(fewer)
    return search


def free_of(problem: Problem, causes: Iterable[CandidateCause]) -> NDArray[np.int64]:
    """Indices of nuisances and of the gains of ``causes``."""
    return np.concatenate([problem.nuisances, [c.index for c in causes]]).astype(int)


def unlike_drives(search: Search, acts: CauseSet) -> Iterator[str]:
    """In words, that the drives are not of one vehicle, beside causes that act in all of them."""
    lin = search.objective.white_at(acts.fit.theta, acts.fit.shapes)
    return unlike(search.objective, lin, search.free(acts.causes))


def _superfluous(search: Search) -> CauseSet | None:
    """The best without a cause that improves the fit too little beside those which joined after
    it: by first order, the wrong one may come first."""
    best = search.best
    fits = sorted((search.without(c, best) for c in best.causes[:-1]), key=cost_of)
    if fits and fits[0].cost - best.cost < search.least_gain(fits[0]):
        return fits[0]
    return None


def _grown(search: Search, parents: Sequence[CauseSet]) -> tuple[Search, list[CauseSet]]:
    """Fits of one more cause beside those of each parent, where one is significant; the search
    with these tried."""
    wanted = list[tuple[tuple[CandidateCause, ...], list[Linearisation]]]()
    tried, p_values = set(search.tried), dict(search.p_values)
    if not search.best.causes:
        for cause in sorted(search.begins, key=lambda c: -search.begins[c][0])[:LEADERS]:
            tried.add(frozenset((cause,)))
            gain, begin = search.begins[cause]
            wanted.append(((cause,), [search.null.fit, begin]))
            p_values[cause.name] = min(
                p_values.get(cause.name, 1.0), search.p_of_improvement(cause, gain)
            )
    for parent in parents:
        others = [c for c in search.candidates if _may_join(c, parent)]
        scores = search.scores(parent, others, seed=2) if parent.causes else search.null_scores
        z = scores.z
        if not others or scores.least_p > LEVEL:
            continue
        begins = _distant_starts(search, parent, others, z) if (z**2).max() > STRONG else {}
        p, squares = scores.p_alone(z), np.where(scores.one_sided, np.maximum(z, 0.0), z) ** 2
        # by first order only: the stronger, the less exact
        enough = squares.max() - CLOSE - 0.4 * max(squares.max() - STRONG, 0.0)
        for i in [i for i in np.argsort(-squares)[:LEADERS] if squares[i] >= enough]:
            causes = (*parent.causes, others[i])
            if frozenset(causes) in tried:
                continue
            tried.add(frozenset(causes))
            wanted.append((causes, [parent.fit, begins[i]] if i in begins else [parent.fit]))
            p_values.setdefault(others[i].name, float(scores.p_family_wise(p[i])))
    count = len(search.free(())) + MOST
    grown = concurrently(search.problem, count, lambda each: search.likeliest(*each), wanted)
    return replace(search, tried=frozenset(tried), p_values=p_values), grown


def _distant_starts(
    search: Search, parent: CauseSet, others: Sequence[CandidateCause], z: Floats
) -> dict[int, Linearisation]:
    """Where else to begin, for those of the ``others`` of which a trial size has a higher score
    than the slope at 0; their scores ``z`` (C) become those of the secants."""
    free, objective = search.free(parent.causes), search.objective
    fit, begins = objective.linearise_at(parent.fit.theta, parent.fit.shapes, free), {}
    projection = Projection.of(fit, free, objective.prior)
    for i, cause in enumerate(others):
        for size in cause.gain.trials:
            theta = fit.theta.copy()
            theta[cause.index] = size / cause.gain.upper
            shapes = {**settings((cause,)), **fit.shapes}
            there = objective.linearise_at(theta, shapes, NO_DERIVATIVES)
            secant = (there.r - fit.r)[:, None]
            of = projection.out_of(secant)
            (score,), ((information,),) = of.score, of.information
            if score > max(z[i], 0.0) * (std := max(information, ABSENT) ** 0.5):
                z[i], begins[i] = score / std, there.bare
    return begins


def with_noise_of_best(search: Search, grown: Sequence[CauseSet]) -> tuple[Search, list[CauseSet]]:
    """The search and the fits with the noise model of the best fit's residuals: what a cause
    explains is no noise.  Without a cause the best fit may lie where that of the cause ended."""
    best = min(grown, key=cost_of)
    objective = _judging_by(search, best)
    free = search.free(())
    search = replace(search, objective=objective)
    null, near = concurrently(
        search.problem,
        len(free) + 1,
        lambda begin: search.fitted_near((), begin),
        (search.null.fit, best.fit),
    )
    null = null.bare
    if near.cost < WALL * null.cost:  # from so high up a wall, nothing leads on
        null = min(null, search.continued(near).bare, key=cost_of)
    search = replace(search, null=null, best=null)
    refit = concurrently(
        search.problem, len(free) + 1, lambda h: search.likeliest(h.causes, [h.fit]), grown
    )
    return search, refit


def _judging_by(search: Search, best: CauseSet) -> Objective:
    """The objective with the noise model of the residuals of the ``best``, and the span of what
    every unknown and candidate changes there and in the model without a cause."""
    at = search.objective.linearise_at(best.fit.theta, best.fit.shapes)
    objective = search.objective.with_noise_of(at)
    at = at.as_measured  # room for the white ones
    objective = objective.with_discrepancies(at)
    at = replace(objective.whitened(at), raw=())  # room for the derivatives
    return spanned(objective, [at, objective.white_at(search.null.fit.theta)], search.candidates)


def _unusual_starts(problem: Problem, theta: Floats) -> NDArray[np.int64]:
    """Which temperatures in ``theta`` (m) drives start from, unlike a clutch at rest."""
    temperatures = {state.name for state in problem.compiled.model.states if state.unit == "°C"}
    unusual = [
        isinstance(t, InitialState) and t.state in temperatures and abs(value) > UNUSUAL
        for t, value in zip(problem.thetas, theta, strict=True)
    ]
    return np.flatnonzero(unusual)


def _may_join(cause: CandidateCause, parent: CauseSet) -> bool:
    """Whether a cause may act beside those of ``parent``: another gain of one of its effects may,
    at the same shapes."""
    same = [c for c in parent.causes if c.name == cause.name]
    return all(c.index != cause.index and c.shapes == cause.shapes for c in same)
