"""The gain of an extension: prediction of data that were not used to identify it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from clutchest.discovery.cause_set import CauseSet
from clutchest.discovery.result import Gain
from clutchest.discovery.search import RELEASED, Search
from clutchest.discovery.torque import torques
from clutchest.inference.concurrent_fits import concurrently
from clutchest.inference.innovations import NO_DERIVATIVES
from clutchest.inference.map_fit import fitted, improve, with_noise_estimated
from clutchest.inference.objective import Objective
from clutchest.inference.problem import Problem
from clutchest.inference.unknowns import InitialState
from clutchest.inference.white_linearisation import Linearisation
from clutchest.signals import Floats

Indices = NDArray[np.int64]

BLOCK = 20.0  # s; what lies closer together is not independent
FEWEST, LEAST = 12, 16  # blocks of a short record, and readings of a slow one in each
RESAMPLED = 1000
PARTS = 4  # of a log, for cross-validation
CHORDS = 4  # what fits a log fits most of it nearly as well


def held_out_gain(
    search: Search, best: CauseSet, other: Problem, than: CauseSet | None = None
) -> Gain:
    """Of a cause set fitted to one problem, on the drives of another; over that of a set with fewer
    causes (``than``), none unless given.

    Gains and shapes are those identified.  All other unknowns are fitted anew, with and without the
    causes, at the cost of their priors: a parameter far off its stated value would be the same
    result by another name.
    """
    objective, than = Objective.of(other), than or search.null
    with_, without = (carried(search.problem, h.fit, other) for h in (best, than))
    shapes, fewer = best.fit.shapes, than.fit.shapes
    # the noise model is that of the residuals with the causes
    objective, after = with_noise_estimated(objective, fitted(objective, with_, shapes))
    objective = objective.with_span([after.psi])
    known, gains = objective.prior > 0.0, objective.prior == 0.0
    begun = after.theta * known + without * gains
    before = min(fitted(objective, without, fewer), fitted(objective, begun, fewer), key=_cost)
    restart = before.theta * known + with_ * gains
    after = min(
        fitted(objective, after.theta, shapes), fitted(objective, restart, shapes), key=_cost
    )
    assert objective.span is not None
    return between(
        HeldOutPrediction.of(objective, before),
        HeldOutPrediction.of(objective, after),
        objective.span,
    )


def _cost(fit: Linearisation) -> float:
    return fit.cost


def carried(problem: Problem, fit: Linearisation, other: Problem) -> Floats:
    """θ of another problem, with the vehicle's unknowns as in a fit of the first one."""
    theta = other.begin.copy()
    theta[: other.shared] = fit.theta[: problem.shared]
    if last := len(problem.tolerated):
        theta[-last:] = fit.theta[-last:]
    return theta


def cross_validated_gain(search: Search, best: CauseSet) -> Gain:
    """Of a cause set on the log in which it was identified, where there is no other: each part of
    the log is predicted with parameters fitted to the rest, initial states estimated anew.  Which
    causes there are was decided on all of it."""
    problem, objective = search.problem, search.objective.with_bounds(RELEASED)
    times = _one_after_another(problem, [d.readings.t for d in problem.drives])
    edges = np.quantile(times, np.linspace(0.0, 1.0, PARTS + 1))[1:-1]
    part = np.searchsorted(edges, times)
    predictions, starts = list[HeldOutPrediction](), _starts(problem)
    for causes in (search.null, best):
        fit = objective.linearise_at(causes.fit.theta, causes.fit.shapes).as_measured
        free, by_starts = search.free(causes.causes), objective.whitened(fit, starts).by_active

        def predicted(
            k: int, fit: Linearisation = fit, free: Indices = free, by_starts: Floats = by_starts
        ) -> HeldOutPrediction:
            """The k-th part, from the rest of the log."""
            rest = objective.without(part == k)
            white = rest.whitened(fit, free)
            rest = rest.with_span([white.by_active])
            begin = rest.judged(white)
            at = improve(rest, begin, free, derivatives=False, chords=CHORDS).as_point
            del white, rest, begin  # before others are made
            at = objective.relinearise(at, at.theta, active=NO_DERIVATIVES)
            begin = replace(at, by_active=by_starts, active=starts)  # it is not far from the fit
            held_out = improve(objective, begin, starts, derivatives=False, chords=CHORDS)
            return HeldOutPrediction.of(objective, held_out).only(partial(_lies, edges, k))

        parts = concurrently(problem, 2 * len(free), predicted, range(PARTS))
        predictions.append(HeldOutPrediction.joined(parts))
    assert objective.span is not None
    before, after = predictions
    return replace(between(before, after, objective.span), other_logs=False)


def _lies(edges: Floats, k: int, t: Floats) -> NDArray[np.bool_]:
    """Which times lie in the ``k``-th of the spans between ``edges`` s."""
    return np.searchsorted(edges, t) == k


def _starts(problem: Problem) -> NDArray[np.int64]:
    """Indices of initial states."""
    return np.array(
        [k for k, t in enumerate(problem.thetas) if isinstance(t, InitialState)], np.int64
    )


def _one_after_another(problem: Problem, times: Sequence[Floats]) -> Floats:
    """Times of all drives on one axis, s, drive after drive."""
    begins = np.cumsum([0.0, *(d.line.t[-1] + BLOCK for d in problem.drives)])
    return np.concatenate([t + begin for t, begin in zip(times, begins, strict=False)])


@dataclass(frozen=True, slots=True)
class HeldOutPrediction:
    """Residuals of predicted readings (K) ``at`` times s: the ``white`` innovations and those over
    their ``own`` standard deviations; the error of the ``torque``, Nm, at ``torque_at`` s; what the
    unknowns behind it ``cost`` in −2 ln(their prior).
    """

    at: Floats
    white: Floats
    own: Floats
    torque_at: Floats
    torque: Floats
    cost: float

    @classmethod
    def of(cls, objective: Objective, fit: Linearisation) -> HeldOutPrediction:
        """At one fit."""
        problem = objective.problem
        simulated = torques(problem, fit)
        return cls(
            _one_after_another(problem, [d.readings.t for d in problem.drives]),
            fit.r,
            np.concatenate([rows.r for rows in fit.raw]),
            _one_after_another(problem, [t for t, _, _ in simulated]),
            np.concatenate([measured - made for _, measured, made in simulated]),
            float(np.sum(objective.prior * fit.theta**2)),
        )

    @property
    def without_torque(self) -> HeldOutPrediction:
        """The same where the torque of the equations is not computed."""
        return replace(self, torque_at=np.zeros(0), torque=np.zeros(0))

    def only(self, when: Callable[[Floats], NDArray[np.bool_]]) -> HeldOutPrediction:
        """The same at times s ``when`` it counts; 0 at other times."""
        mine, its = when(self.at), when(self.torque_at)
        return HeldOutPrediction(
            self.at,
            self.white * mine,
            self.own * mine,
            self.torque_at,
            self.torque * its,
            self.cost,
        )

    @classmethod
    def joined(cls, parts: Sequence[HeldOutPrediction]) -> HeldOutPrediction:
        """Parts put together; the vehicle is one, and its parameters cost once."""
        white, own, torque = (
            np.sum([getattr(one, name) for one in parts], axis=0)
            for name in ("white", "own", "torque")
        )
        cost = float(np.mean([one.cost for one in parts]))
        return cls(parts[0].at, white, own, parts[0].torque_at, torque, cost)


def between(before: HeldOutPrediction, after: HeldOutPrediction, span: Floats) -> Gain:
    """What lies outside of the ``span`` (K, q) is noise of the inputs and the same for both."""
    inside = [span @ (span.T @ one.white) for one in (before, after)]
    noise = (after.white - inside[1]) ** 2
    old, new = inside[0] ** 2 + noise, inside[1] ** 2 + noise
    gained = (before.cost - after.cost) / 2.0 + _interval((old - new) / 2.0, before.at)
    return Gain(
        rmse_before=_root_mean_square(before.own) or 0.0,
        rmse_after=_root_mean_square(after.own) or 0.0,
        nll_before=float(old.sum() + before.cost) / 2.0,
        nll_after=float(new.sum() + after.cost) / 2.0,
        simulation_rmse_before=_root_mean_square(before.torque),
        simulation_rmse_after=_root_mean_square(after.torque),
        ci95=(float(gained[0]), float(gained[1])),
    )


def _interval(gained: Floats, at: Floats) -> Floats:
    """95 % confidence interval of the sum of what is ``gained`` (K) ``at`` times s: block
    bootstrap."""
    _, of = np.unique(np.floor(at / block_length(at)), return_inverse=True)
    sums = np.bincount(of, gained)
    rng = np.random.default_rng(0)
    drawn = sums[rng.integers(len(sums), size=(RESAMPLED, len(sums)))].sum(axis=1)
    return np.quantile(drawn, [0.025, 0.975])


def block_length(at: Floats) -> float:
    """s of a block of readings ``at`` (K) times s: ``BLOCK`` where the record is long enough for
    ``FEWEST`` of them, and its readings come often enough for ``LEAST`` in each."""
    if len(at) < 2:
        return BLOCK
    span = float(np.ptp(at))
    return max(min(BLOCK, span / FEWEST), LEAST * span / len(at), 1e-9)


def _root_mean_square(values: Floats) -> float | None:
    return float(np.sqrt(np.mean(values**2))) if len(values) else None
