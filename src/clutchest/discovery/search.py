"""The search: which causes, alone or together, the data ask for."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from clutchest.discovery.candidates import Candidate, candidates, settings
from clutchest.inference.continuation import continue_towards_prior
from clutchest.inference.map_fit import improve, settle
from clutchest.inference.objective import NO_DERIVATIVES, SAME, Linearisation, Objective
from clutchest.inference.problem import Problem
from clutchest.inference.score_test import (
    ABSENT,
    NOT_EXCLUDED,
    ScoreTest,
    projected_out,
    score_test,
)
from clutchest.inference.unknowns import InitialState
from clutchest.progress import Progress
from clutchest.signals import Floats

LEVEL = 0.0085  # family-wise chance of a false finding; the rest to 1 % is for what has no name
LEADERS, PARENTS = 8, 3  # fitted in full: causes alone, and causes to which another may join
MOST = 3  # causes acting together
CLOSE = 10.0  # of −2 ln(probability): by how much a cause may lag by first order to be fitted
STRONG = 2.0 * CLOSE  # of a score, squared: from here on, the first order is not exact
INEXACT = 2e-4  # of what causes explain: what equations that are 1 % off leave of it, no cause
BEYOND = 1.25  # of its largest plausible size: how far a gain may go that is there
ODD, WARM = 3.0, 3.0  # standard deviations of where a clutch at rest starts: further off, the log
# begins in the middle of a drive, and where it starts is known so many times less well
PER_SHAPE = 1.0  # the same: what the choice among the values of a shape gains by noise alone


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """Causes acting together, fitted; ``cost`` −2 ln(probability) up to a constant.  The ``fit``
    may be bare."""

    chosen: tuple[Candidate, ...]
    fit: Linearisation

    @property
    def cost(self) -> float:
        """Of the fit, with what the choice of shapes is worth by itself."""
        return self.fit.cost + PER_SHAPE * sum(bool(c.shapes) for c in self.chosen)

    @property
    def bare(self) -> Hypothesis:
        """The same with a bare fit."""
        return replace(self, fit=self.fit.bare)

    @property
    def names(self) -> frozenset[str]:
        """Names of the effects."""
        return frozenset(c.name for c in self.chosen)


@dataclass(slots=True)
class Search:
    """One search over one problem.

    ``null`` the model as it is, ``first`` the scores of all causes against it; ``best`` the causes
    found (none at first), ``rivals`` hypotheses of the same size, best first; ``p_of`` by effect
    the family-wise p-value of its score when it was first tried; ``tried`` what has been fitted;
    ``sizes`` the best and its rivals at every number of causes.  ``running``: indices of
    temperatures from which drives start, and no clutch at rest would.
    """

    problem: Problem
    objective: Objective
    all: tuple[Candidate, ...]
    null: Hypothesis
    first: ScoreTest
    best: Hypothesis
    running: NDArray[np.int64]
    rivals: list[Hypothesis] = field(default_factory=list)
    p_of: dict[str, float] = field(default_factory=dict)
    tried: set[frozenset[Candidate]] = field(default_factory=set)
    sizes: dict[int, list[Hypothesis]] = field(default_factory=dict)

    @classmethod
    def begin(cls, problem: Problem, progress: Progress | None = None) -> Search:
        """The model as it is, fitted to its priors, and every cause's score."""
        if progress:
            progress("fitting the model as it is", None)
        objective, fit = settle(Objective.of(problem), np.zeros(len(problem.thetas)))
        running = _running(problem, fit.theta)
        if len(running):
            objective, fit = settle(objective.with_prior(running, WARM), fit.theta)
        null, every = Hypothesis((), objective.relinearise(fit, fit.theta)), candidates(problem)
        search = cls(problem, objective, every, null, None, null, running)  # type: ignore[arg-type]
        columns = search.columns(null.fit, every)
        search.objective = objective = objective.with_span([null.fit.psi, columns])
        search.null = search.best = null = Hypothesis((), objective.whitened(null.fit))
        search.first = search.scored(null, every, columns, seed=1)
        search.null = search.best = null.bare
        return search

    def columns(self, fit: Linearisation, wanted: Sequence[Candidate]) -> Floats:
        """Derivatives (K, C) of the innovations by each candidate's gain at a fit."""
        found = np.zeros((len(fit.r), len(wanted)))
        plain = [i for i, c in enumerate(wanted) if not c.shapes]
        found[:, plain] = fit.psi[:, [wanted[i].index for i in plain]]
        rest = [i for i, c in enumerate(wanted) if c.shapes]
        while rest:  # one linearisation serves one value of every effect's shapes
            now = {wanted[i].name: i for i in reversed(rest)}
            some = [i for i in rest if wanted[i].shapes == wanted[now[wanted[i].name]].shapes]
            shapes = settings(tuple(wanted[i] for i in now.values()))
            active = np.array([wanted[i].index for i in some])
            shaped = self.objective.relinearise(fit, fit.theta, {**shapes, **fit.shapes}, active)
            found[:, some] = shaped.psi[:, active]
            rest = [i for i in rest if i not in some]
            del shaped  # before the next one is made
        return found

    def scores(self, base: Hypothesis, wanted: Sequence[Candidate], seed: int) -> ScoreTest:
        """Scores of ``wanted`` beside the causes in ``base``."""
        fit = self.objective.linearise_at(base.fit.theta, base.fit.shapes)
        return self.scored(replace(base, fit=fit), wanted, self.columns(fit, wanted), seed)

    def scored(
        self, base: Hypothesis, wanted: Sequence[Candidate], columns: Floats, seed: int
    ) -> ScoreTest:
        """The same where derivatives ``columns`` (K, C) of the innovations are known."""
        return score_test(
            base.fit,
            self.free(base.chosen),
            self.objective.prior,
            columns,
            [c.gain.one_sided for c in wanted],
            seed,
        )

    def free(self, chosen: Iterable[Candidate]) -> NDArray[np.int64]:
        """Indices of nuisances and of the gains of ``chosen``."""
        return np.concatenate([self.problem.nuisances, [c.index for c in chosen]]).astype(int)

    def fitted(self, chosen: tuple[Candidate, ...], begin: Linearisation) -> Hypothesis:
        """These causes, most probable sizes, from ``begin`` on."""
        free, shapes = self.free(chosen), settings(chosen)
        kept = {c.index for c in chosen}
        bent = begin.theta.copy()
        bent[[i for i in self.problem.gains if i not in kept]] = 0.0
        best = improve(self.objective, self.objective.linearise_at(bent, shapes, free), free)
        return Hypothesis(chosen, continue_towards_prior(self.objective, best, free))

    def released(self, h: Hypothesis) -> Hypothesis:
        """A hypothesis with a fit that is not bare, and sizes that need not be plausible: that
        decides which causes there are, and the data how much there is of them."""
        fit, objective = self.objective.linearise_at(h.fit.theta, h.fit.shapes), self.objective
        gains = [c.index for c in h.chosen]
        sizes = fit.theta[gains]
        if np.any((sizes <= objective.low[gains]) | (sizes >= objective.high[gains])):
            fit = improve(objective.with_bounds(BEYOND), fit, self.free(h.chosen))
        return replace(h, fit=fit)

    def run(self, progress: Progress | None = None) -> None:
        """Find what there is to find: ``best``, ``rivals``, ``p_of``."""
        while len(self.best.chosen) < MOST:
            size = len(self.best.chosen)
            if progress:
                progress(f"trying {size + 1} cause{'s' if size else ''}", size / MOST)
            grown = self._grown([self.best, *self.rivals][:PARENTS])
            if grown and not size:
                grown = self._relearned(grown)
            least = self.least_gain(self.best)
            if not grown or self.best.cost - min(h.cost for h in grown) < least:
                break
            grown.sort(key=lambda h: h.cost)
            self.sizes[size + 1] = grown
            self.best, self.rivals = grown[0], grown[1:]
            if spared := self._spared():
                self.settle_for(spared)

    def _spared(self) -> Hypothesis | None:
        """The best without a cause that brings too little beside those which joined after it: by
        first order, the wrong one may come first."""
        fits = sorted(map(self.without, self.best.chosen[:-1]), key=lambda h: h.cost)
        if fits and fits[0].cost - self.best.cost < self.least_gain(fits[0]):
            return fits[0]
        return None

    def without(self, cause: Candidate, of: Hypothesis | None = None) -> Hypothesis:
        """The best, or another hypothesis, less one of its causes."""
        of = of or self.best
        rest = tuple(c for c in of.chosen if c is not cause)
        return self.fitted(rest, of.fit)

    def established(self, cause: Candidate, of: Hypothesis) -> tuple[float, float]:
        """What a cause of a hypothesis brings beside its others, in −2 ln(probability), and the
        family-wise chance that noise alone brings as much to any."""
        if len(of.chosen) == 1:
            return self.null.cost - of.cost, self.p_of.get(cause.name, 0.0)
        brings = self.released(self.without(cause, of)).cost - of.cost
        one_sided = 1.0 if cause.gain.one_sided else 2.0
        p = one_sided * norm.sf(np.sqrt(max(brings, 0.0)))
        return brings, float(self.first.p_family_wise(p))

    def settle_for(self, fewer: Hypothesis) -> None:
        """Take a hypothesis with fewer causes for the best."""
        same = self.sizes[len(fewer.chosen)]
        self.best, self.rivals = fewer, [h for h in same if h.names != fewer.names]
        self.sizes[len(fewer.chosen)] = [fewer, *self.rivals]

    def move_to(self, there: Hypothesis) -> None:
        """Begin again from a hypothesis at quite other numbers, or from a rival of as many causes
        that is better there."""
        size = len(there.chosen)
        rivals = [
            self.fitted(h.chosen, there.fit).bare
            for h in self.sizes.get(size, [])
            if h.names != there.names
        ]
        self.sizes[size] = sorted([there, *rivals], key=lambda h: h.cost)
        self.best, *self.rivals = self.sizes[size]
        self.tried.clear()
        if not size:
            self.null = self.best = there.bare
            self.first = self.scores(there, self.all, seed=1)

    def stays(self, more: float, than: Hypothesis | None = None) -> bool:
        """Whether the best is still found, not one ``than`` it with fewer causes (none unless
        given), when other drives add ``more`` to what it brings, in −2 ln(probability)."""
        than = than or self.null
        brings = than.cost - self.best.cost + more
        return brings >= (len(self.best.chosen) - len(than.chosen)) * self.least_gain()

    def least_gain(self, beside: Hypothesis | None = None) -> float:
        """In −2 ln(probability), what one more cause must bring, ``beside`` others more than what
        may be left of them because equations are not exact."""
        more_than_noise = float(np.min(self.first.threshold(LEVEL))) ** 2
        explained = self.null.cost - beside.cost if beside else 0.0
        return max(more_than_noise, INEXACT * explained)

    def _grown(self, parents: Sequence[Hypothesis]) -> list[Hypothesis]:
        """Fits of one more cause beside those of each parent, where one is significant."""
        found: list[Hypothesis] = []
        for parent in parents:
            others = [c for c in self.all if _may_join(c, parent)]
            scores = self.scores(parent, others, seed=2) if parent.chosen else self.first
            z, p = scores.z, scores.p_alone(scores.z)
            if not others or scores.p_family_wise(p.min()) > LEVEL:
                continue
            begins = self._afar(parent, others, z) if (z**2).max() > STRONG else {}
            p, squares = scores.p_alone(z), np.where(scores.one_sided, np.maximum(z, 0.0), z) ** 2
            # by first order only: the stronger, the less exact
            enough = squares.max() - CLOSE - 0.4 * max(squares.max() - STRONG, 0.0)
            for i in [i for i in np.argsort(-squares)[:LEADERS] if squares[i] >= enough]:
                chosen = (*parent.chosen, others[i])
                if frozenset(chosen) in self.tried:
                    continue
                self.tried.add(frozenset(chosen))
                fits = [self.fitted(chosen, parent.fit)]
                fits += [self.fitted(chosen, begins[i])] if i in begins else []
                found.append(min(fits, key=lambda h: h.cost).bare)
                self.p_of.setdefault(others[i].name, float(scores.p_family_wise(p[i])))
        return found

    def _afar(
        self, parent: Hypothesis, others: Sequence[Candidate], z: Floats
    ) -> dict[int, Linearisation]:
        """Where else to begin, for those of the ``others`` of which a size that may be tried shows
        more than the slope at 0 does; their scores ``z`` (C) become those of the secants."""
        free, objective = self.free(parent.chosen), self.objective
        fit, begins = objective.linearise_at(parent.fit.theta, parent.fit.shapes, free), {}
        for i, cause in enumerate(others):
            for size in cause.gain.trials:
                theta = fit.theta.copy()
                theta[cause.index] = size / cause.gain.upper
                shapes = {**settings((cause,)), **fit.shapes}
                there = objective.linearise_at(theta, shapes, NO_DERIVATIVES)
                secant = (there.r - fit.r)[:, None]
                of = projected_out(fit, free, objective.prior, secant)
                (score,), ((information,),) = of.score, of.information
                if score > max(z[i], 0.0) * (std := max(information, ABSENT) ** 0.5):
                    z[i], begins[i] = score / std, there.bare
        return begins

    def _relearned(self, grown: list[Hypothesis]) -> list[Hypothesis]:
        """The same fits with the noise that the best of them leaves over: what a cause explains
        is none."""
        best = min(grown, key=lambda h: h.cost)
        at = self.objective.linearise_at(best.fit.theta, best.fit.shapes)
        self.objective = self.objective.with_noise_of(at)
        at = self.objective.whitened(at)
        known = [at.psi, self.columns(at, self.all)]
        null = self.objective.linearise_at(self.null.fit.theta)
        known += [null.psi, self.columns(null, self.all)]
        self.objective = self.objective.with_span(known, SAME)
        null = improve(self.objective, self.objective.whitened(null), self.free(()))
        self.null = self.best = Hypothesis((), null.bare)
        return [self.fitted(h.chosen, h.fit).bare for h in grown]

    def tied(self) -> list[Hypothesis]:
        """Rivals of the same size that the data do not exclude."""
        return [
            h
            for h in self.rivals
            if h.cost - self.best.cost < NOT_EXCLUDED and h.names != self.best.names
        ]


def _running(problem: Problem, theta: Floats) -> NDArray[np.int64]:
    """Which temperatures in ``theta`` (m) drives start from that no clutch at rest has."""
    warm = {state.name for state in problem.compiled.model.states if state.unit == "°C"}
    odd = [
        isinstance(t, InitialState) and t.state in warm and abs(value) > ODD
        for t, value in zip(problem.thetas, theta, strict=True)
    ]
    return np.flatnonzero(odd)


def _may_join(cause: Candidate, parent: Hypothesis) -> bool:
    """Whether a cause may act beside those of ``parent``: another gain of an effect that is there
    may, at the same shapes."""
    same = [c for c in parent.chosen if c.name == cause.name]
    return all(c.index != cause.index and c.shapes == cause.shapes for c in same)
