"""Sizes of strong faults: the equations linearised again with the fault in them.

Faults are detected and isolated by derivatives at a healthy vehicle, at an operating point that the
fault has biased.  A strong fault is not proportional to its derivative there: a clutch that fades
transmits less torque, stays cooler, and fades less.  So the most probable faults are put into the
equations, fitted together with all nuisances, and their sizes estimated by derivatives there.

One that begins within the drive acts in the equations from its likeliest onset on.  Where what is
left with its effect taken out is far from noise all the same, its size is not determined.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from clutchest.diagnosis.blocks import Blocks, PresentFault, blocks_at
from clutchest.diagnosis.fault_tests import FaultTestResults, surprise
from clutchest.diagnosis.isolation import AROUND, Explanation, FaultHypothesis, hypotheses
from clutchest.diagnosis.recursive_residuals import onset_scores, recursive_residuals
from clutchest.inference.innovations import NO_DERIVATIVES
from clutchest.inference.map_fit import NEAR, brought_near, improve, step
from clutchest.inference.objective import Objective
from clutchest.inference.problem import Problem
from clutchest.inference.score_test import NOT_EXCLUDED
from clutchest.inference.white_linearisation import Linearisation
from clutchest.progress import Progress
from clutchest.signals import Floats

STRONG = 5.0  # standard deviations; of a weaker fault the first-order size is within its interval
PARTS = 16  # of a time, in each of which an onset is tried with the derivatives of the best so far


@dataclass(frozen=True, slots=True)
class _Fit:
    """Size and standard deviation, in units, of a fault; the ``improvement`` of the fit, 2 Δ ln L.

    Over the blocks since its onset: ``left``, the mean square of residuals with its effect taken
    out, of ``count`` readings, where 1 is noise as the drive shows it; and how far these are
    ``off`` at the operating point, in standard deviations that the vehicle file states.
    """

    size: float
    std: float
    improvement: float
    left: float
    count: int
    off: float

    def is_noise(self, results: FaultTestResults) -> bool:
        """Whether what is left may be noise: by the test of a block's misfit, over all blocks
        since, and near enough to what is stated.  Noise as the drive shows it holds what comes
        slowly, whatever its size."""
        ratio = np.array([self.left / results.noise_model.level**2])
        likely = surprise(ratio, np.array([self.count]))[0] < results.misfit_at
        return bool(likely and self.off**2 < NEAR)

    def times_noise(self, results: FaultTestResults) -> float:
        """How many times as large as noise what is left is."""
        return max(float(np.sqrt(max(self.left, 0.0))) / results.noise_model.level, self.off)


def refitted(
    problem: Problem,
    results: FaultTestResults,
    causes: Sequence[Explanation],
    progress: Progress | None = None,
) -> tuple[Explanation, ...]:
    """The ``causes`` in a drive's ``problem`` with the refitted sizes of those that are not
    excluded, and strong or leave more than noise; they are present from the start as far as that
    explains the drive as well as a later onset.  What none of that explains has no size.
    """
    known = {h.name: h for h in hypotheses(results)}
    refits = []
    for cause in causes:
        if cause.behind < NOT_EXCLUDED:
            h = known[cause.fault]
            fit = _fit(results.blocks, h, cause.onset)
            if abs(cause.size) > STRONG * cause.std or not fit.is_noise(results):
                cause, fit = _refitted(problem, results, h, cause, fit, progress)
            if not fit.is_noise(results):
                cause = replace(cause, left=fit.times_noise(results))
        refits.append(cause)
    return tuple(refits)


def _refitted(
    problem: Problem,
    results: FaultTestResults,
    h: FaultHypothesis,
    cause: Explanation,
    fit: _Fit,
    progress: Progress | None,
) -> tuple[Explanation, _Fit]:
    """A cause with the size that it has in the equations, where that explains the drive; and the
    fit that this is from: the first-order ``fit`` where it is not."""
    present = PresentFault(h.index, cause.size / h.scale)
    blocks = blocks_at(problem, present, progress)
    always = _fit(blocks, h, 0)
    later = _fit(blocks, h, cause.onset).improvement if cause.onset else -np.inf
    if always.improvement > later - NOT_EXCLUDED:
        cause, fit = _sized(cause, h, always), always
        if fit.is_noise(results):
            return cause, fit
    if h.only_from_start:
        return cause, fit
    begun = _begun(problem, results, h, cause)
    blocks = blocks_at(problem, begun, progress)
    onset = int(np.searchsorted(blocks.end, begun.onset))
    since = _fit(blocks, h, 0, onset)  # before its onset, derivatives by it are 0
    if not since.is_noise(results) and since.times_noise(results) > fit.times_noise(results):
        return cause, fit
    return replace(_sized(cause, h, since), onset=onset, began_s=begun.onset), since


def _sized(cause: Explanation, h: FaultHypothesis, fit: _Fit) -> Explanation:
    return replace(cause, size=fit.size * h.scale, std=fit.std * h.scale)


def _fit(blocks: Blocks, h: FaultHypothesis, onset: int, first: int | None = None) -> _Fit:
    """Of a fault that acts as its derivatives say from block ``onset`` on; where its equations have
    an onset themselves, that is in block ``first``."""
    residuals = recursive_residuals(blocks, [h.index])
    of = onset_scores(blocks, [h.index], residuals.before, onset, len(blocks))
    score, information = float(of.score[-1, 0]), float(of.information[-1, 0, 0])
    size, std = 0.0, np.inf
    if information > 0.0:
        size = float(np.clip(score / information, 0.0 if h.one_sided else -1.0, 1.0))
        std = information**-0.5
    improvement = 2.0 * size * score - size**2 * information
    since = slice(onset if first is None else first, None)
    count = int(residuals.count[since].sum())
    square = float(residuals.chi_square[since].sum()) - improvement
    off = float(np.median(blocks.off[since]))
    return _Fit(size, std, improvement, square / max(count, 1), count, off)


def _begun(
    problem: Problem, results: FaultTestResults, h: FaultHypothesis, cause: Explanation
) -> PresentFault:
    """A fault in the equations from its likeliest onset on, close to the ``cause``'s block, whose
    begin it is unless the data exclude that; and its size there.  Both are of noise of the stated
    level: what is far off would pass for noise else."""
    grows = any(r.fault.grows_as for r in results.faults if r.fault.name == h.name)
    begin, last = results.blocks.begin, len(results.blocks) - 1
    own = np.clip(cause.onset, min(1, last), last)
    some = np.arange(cause.onset - AROUND, cause.onset + AROUND + 1)
    onsets = begin[np.unique(np.clip(some, min(1, last), last))]
    free = np.append(problem.nuisances, h.index)

    def at(onset: float) -> Objective:
        return Objective.of(PresentFault(h.index, 0.0, onset, grows).put_into(problem))

    def fitted(onset: float, near: Floats = problem.near) -> tuple[float, Linearisation]:
        objective = at(onset)
        start = brought_near(objective, objective.linearise_at(near, active=free), free)
        return onset, improve(objective, start, free, derivatives=False)

    onset, lin = fitted(float(begin[own]))
    found = [fitted(float(each)) for each in onsets[onsets != onset]]
    while True:
        likely = min(found, key=lambda each: each[1].cost, default=(onset, lin))
        if likely[1].cost + NOT_EXCLUDED < lin.cost:
            onset, lin = likely
        place = int(np.argmin(np.abs(onsets - onset)))
        low, high = onsets[max(place - 1, 0)], onsets[min(place + 1, len(onsets) - 1)]
        if high - low < _period(problem.drives[0].readings.t):
            break
        lin = at(onset).relinearise(lin, lin.theta, active=free)
        onsets = np.linspace(low, high, PARTS + 1)
        costs = [_nearly(at(float(each)), lin, free) for each in onsets]
        if np.ptp(costs) < 1.0:  # within the onset's standard deviation
            break
        found = [fitted(float(onsets[np.argmin(costs)]), lin.theta)]
    return PresentFault(h.index, float(lin.theta[h.index]), onset, grows)


def _nearly(objective: Objective, lin: Linearisation, free: NDArray[np.int64]) -> float:
    """What the fit of ``free`` unknowns (indices) costs at an onset, by the derivatives at a
    linearisation with another one."""
    there = objective.relinearise(lin, lin.theta, active=NO_DERIVATIVES)
    there = replace(there, by_active=lin.by_active, active=lin.active)
    move = step(objective, there, free)
    rest = there.r + there.change(move)
    return float(rest @ rest + np.sum(objective.prior * (there.theta + move) ** 2))


def _period(t: Floats) -> float:
    """s from one of the readings at ``t`` (K) to the next."""
    return float(np.median(np.diff(np.unique(t))))
