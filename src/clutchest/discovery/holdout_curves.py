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
from clutchest.discovery.residual_curves import Curve, places
from clutchest.discovery.result import Gain
from clutchest.discovery.search import Search
from clutchest.inference.covariates import covariates, hats, measured_at_rest
from clutchest.inference.linearisation import Modulation
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
    """

    curves: tuple[Curve, ...]
    span: Floats
    before: HeldOutPrediction
    after: tuple[HeldOutPrediction, ...]

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
        place = places(other)
        points = zip(other.drives, fit.implied, strict=True)
        values = [covariates(drive, measured_at_rest(drive, at)) for drive, at in points]
        changes = np.zeros((len(fit.r), len(curves)))
        for change, curve in zip(changes.T, curves, strict=True):
            count = len(curve.at)
            bases = [hats(value[curve.covariate], curve.at) for value in values]
            thetas = np.full(count, place[curve.error_term])
            modulations = [Modulation(basis, np.arange(count)) for basis in bases]
            acts = objective.modulated(fit, thetas, modulations)
            change[:] = acts @ curve.coefficients
        objective = objective.with_span([fit.psi, changes])
        assert objective.span is not None
        own, among = fit.psi[:, free], HeldOutPrediction.of(objective, fit)
        curvature = own.T @ own + np.eye(len(free))

        def refitted(r: Floats) -> HeldOutPrediction:
            step = np.linalg.solve(curvature, own.T @ r + fit.theta[free])
            white = r - own @ step
            shrunk = float(np.sqrt(np.sum(white**2) / np.sum(fit.r**2)))
            cost = float(np.sum((fit.theta[free] - step) ** 2))
            return replace(among, white=white, own=among.own * shrunk, cost=cost)

        after = tuple(refitted(fit.r + change).without_torque for change in changes.T)
        return cls(tuple(curves), objective.span, refitted(fit.r), after)

    def ranked(self) -> list[Curve]:
        """The most likely first, by both problems."""
        gained = np.sum(self._gained(), axis=1)
        return [self.curves[i] for i in np.argsort(-self._evidence(gained), kind="stable")]

    def best(self, usable: Sequence[bool]) -> tuple[Curve | None, Gain | None]:
        """Of the ``usable`` curves (n) the most likely by both problems, and what it gains.

        For each half of the drives the curve is selected by the log and the other half: a gain is
        measured on data that were not used for the selection.
        """
        gained = self._gained()
        chosen = self._chosen(np.sum(gained, axis=1), usable)
        if chosen is None:
            return None, None
        halves = [self._chosen(2.0 * gained[:, 1 - k], usable) for k in (0, 1)]
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

    def _gained(self) -> Floats:
        """ln(probability) that each curve gains in each half of the drives (n, 2)."""
        second = _in_half(1, block_length(self.before.at), self.before.at).astype(np.int64)
        old = (self.span @ (self.span.T @ self.before.white)) ** 2
        gains = np.zeros((len(self.curves), 2))
        for i, after in enumerate(self.after):
            new = (self.span @ (self.span.T @ after.white)) ** 2
            sums = np.bincount(second, old - new, minlength=2)
            gains[i] = (sums + (self.before.cost - after.cost) / 2.0) / 2.0
        return gains


def _in_half(k: int, length: float, t: Floats) -> NDArray[np.bool_]:
    """Which times s are in the first or the second half: blocks of that ``length`` s in turns."""
    return t // length % 2 == k
