"""Held-out prediction with curves: an error correlates with the same covariate in other drives.

Within one drive covariates correlate with each other: bodies warm as time passes, and speeds fall
as the plate comes back.  In a drive on another road they do less.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from clutchest.discovery.cause_set import CauseSet
from clutchest.discovery.holdout_gain import (
    HeldOutPrediction,
    between,
    block_length,
    carried,
)
from clutchest.discovery.residual_curves import Curve, CurvesAt
from clutchest.discovery.result import Gain
from clutchest.discovery.search import Search
from clutchest.inference.map_fit import fitted, improve, with_noise_estimated
from clutchest.inference.objective import Objective
from clutchest.inference.problem import Problem
from clutchest.models.effects.effect import TIME
from clutchest.signals import Floats


@dataclass(frozen=True, slots=True)
class HeldOutCurves:
    """Predictions of the readings (K) of another problem without and with each of ``curves`` (n) as
    they were estimated, all other unknowns fitted anew, to first order.

    ``span`` (K, q): what lies outside of it is noise of the inputs and the same for all.
    ``gained`` (n, 3): ln(probability) of the readings, and of each half of them, that curves gain
    which may be off by as much as they are uncertain: what a log does not tell, as where it has
    never been, no other drive denies.
    """

    curves: tuple[Curve, ...]
    span: Floats
    before: HeldOutPrediction
    after: tuple[HeldOutPrediction, ...]
    gained: Floats

    @classmethod
    def of(
        cls,
        search: Search,
        curves: Sequence[Curve],
        other: Problem,
        beside: CauseSet | None = None,
    ) -> HeldOutCurves:
        """Curves of a search on the drives of another problem, ``beside`` a set of causes as they
        were identified (none unless given)."""
        beside = beside or search.null
        objective, free = Objective.of(other), other.nuisances
        fit = fitted(objective, carried(search.problem, beside.fit, other), beside.fit.shapes)
        objective, fit = with_noise_estimated(objective, fit)
        objective = objective.with_span([fit.psi])
        fit = improve(objective, objective.judged(fit), free)
        at, own = CurvesAt.of(objective, fit), fit.psi[:, free]
        among = HeldOutPrediction.of(objective, fit)
        changes, gained = np.zeros((len(fit.r), len(curves))), np.zeros((len(curves), 3))
        length = block_length(among.at)
        parts = [np.ones(len(fit.r), bool), *(_in_half(k, length, among.at) for k in (0, 1))]
        theta = fit.theta[free]
        without = [_likely(fit.r[part], own[part], theta) for part in parts]
        for i, curve in enumerate(curves):
            acts = at.by_coefficients(curve)
            changes[:, i], off = acts @ curve.coefficients, acts @ curve.off.T
            likely = [
                _likely(fit.r[part] + changes[part, i], own[part], theta, off[part])
                for part in parts
            ]
            gained[i] = np.subtract(likely, without)
        objective = objective.with_span([fit.psi, changes])
        assert objective.span is not None
        curvature = own.T @ own + np.eye(len(free))

        def refitted(r: Floats) -> HeldOutPrediction:
            step = np.linalg.solve(curvature, own.T @ r + fit.theta[free])
            white = r - own @ step
            shrunk = float(np.sqrt(np.sum(white**2) / np.sum(fit.r**2)))
            cost = float(np.sum((fit.theta[free] - step) ** 2))
            return replace(among, white=white, own=among.own * shrunk, cost=cost)

        after = tuple(refitted(fit.r + change).without_torque for change in changes.T)
        return cls(tuple(curves), objective.span, refitted(fit.r), after, gained)

    def ranked(self) -> list[Curve]:
        """The most likely first, by both problems."""
        likely = self._evidence(self.gained[:, 0])
        return [self.curves[i] for i in np.argsort(-likely, kind="stable")]

    def best(self, usable: Sequence[bool]) -> tuple[Curve | None, Gain | None]:
        """Of the ``usable`` curves (n) the most likely by both problems, and what it gains.

        For each half of the drives the curve is selected by the log and the other half: a gain is
        measured on data that were not used for the selection.
        """
        chosen = self._chosen(self.gained[:, 0], usable)
        if chosen is None:
            return None, None
        halves = [self._chosen(2.0 * self.gained[:, 2 - k], usable) for k in (0, 1)]
        length = block_length(self.before.at)
        parts = [
            (self.before if i is None else self.after[i]).only(partial(_in_half, k, length))
            for k, i in enumerate(halves)
        ]
        after = HeldOutPrediction.joined(parts)
        return self.curves[chosen], between(self.before, after, self.span)

    def _chosen(self, gained: Floats, usable: Sequence[bool]) -> int | None:
        """Index of the most likely one with gains ``gained`` (n); a curve over time must gain."""
        # an error at some time of one drive need not recur at that time of another
        allowed = [
            yes and (curve.covariate != TIME or gain > 0.0)
            for yes, curve, gain in zip(usable, self.curves, gained, strict=True)
        ]
        likely = np.where(allowed, self._evidence(gained), -np.inf)
        return int(np.argmax(likely)) if any(allowed) else None

    def _evidence(self, gained: Floats) -> Floats:
        """2 ln of the Bayes factor (n) on both problems, with the gains (n) ``gained`` on the
        other; a curve over time is not refuted by another drive."""
        over_time = np.array([curve.covariate == TIME for curve in self.curves])
        counts = np.where(over_time, np.maximum(gained, 0.0), gained)
        return np.array([curve.evidence for curve in self.curves]) + 2.0 * counts


def _likely(r: Floats, own: Floats, theta: Floats, off: Floats | None = None) -> float:
    """ln(probability) of innovations ``r`` (K), up to a constant, that respond by ``own`` (K, n) to
    unknowns of standard deviation 1, which are at ``theta`` (n); and that are uncertain by ``off``
    (K, c), a standard deviation each, where it is given."""
    by = own if off is None else np.column_stack([own, off])
    theta = np.append(theta, np.zeros(by.shape[1] - len(theta)))
    curvature, slope = by.T @ by + np.eye(len(theta)), by.T @ r + theta
    least = r @ r + theta @ theta - slope @ np.linalg.solve(curvature, slope)
    return -0.5 * float(least + np.linalg.slogdet(curvature)[1])


def _in_half(k: int, length: float, t: Floats) -> NDArray[np.bool_]:
    """Which times s are in the first or the second half: blocks of that ``length`` s in turns."""
    return t // length % 2 == k
