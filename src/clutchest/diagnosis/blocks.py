"""Blocks of a drive: the sufficient statistics of each slip and each rest.

A block is a stretch of readings without a pause.  The fault tests need only the Gram matrix of its
whitened innovations and their derivatives by every unknown; the Gram matrix of several blocks is
the sum of theirs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from clutchest.inference.fitted_gains import with_fitted_gains
from clutchest.inference.innovations import NormalisedInnovations
from clutchest.inference.later_gains import beginning_at, from_the_start
from clutchest.inference.map_fit import most_probable, settle
from clutchest.inference.noise_model import NoiseModel, median_std
from clutchest.inference.objective import Objective
from clutchest.inference.prepared_drive import Readings
from clutchest.inference.problem import Problem
from clutchest.inference.unknowns import Unknown, UnknownGain
from clutchest.models.effects import Effect
from clutchest.models.symbols import State
from clutchest.progress import Progress
from clutchest.signals import Floats, Signals
from clutchest.vehicle import Vehicle
from clutchest.vehicle.state_uncertainty import Wander, wander

PAUSE_S, LONGEST_S = 2.0, 5.0  # a longer pause ends a block, and so does this length
OUTLIER = 5.0  # standard deviations after whitening; such a reading is left out
STRETCH = 3000  # readings that are fitted together when the noise model is estimated


@dataclass(frozen=True, slots=True)
class Blocks:
    """The B blocks of one drive.

    ``states`` of the machine, whose initial values are among the ``thetas`` (m), and how far they
    ``wander`` in a healthy vehicle, where they do; ``begin``, ``end`` s (B); ``count`` of readings
    (B); ``off`` (B): how far innovations at the operating point are off in the median, in standard
    deviations that the vehicle file states; ``gram`` (B, 1 + m, 1 + m) of the whitened innovations
    at θ = 0 and their derivatives by each of the thetas in its unit.
    """

    states: tuple[State, ...]
    wander: tuple[Wander, ...]
    thetas: tuple[Unknown, ...]
    begin: Floats
    end: Floats
    count: NDArray[np.int64]
    off: Floats
    gram: Floats

    def __len__(self) -> int:
        return len(self.end)

    def pause(self, k: int) -> float:
        """Time from the block before to block ``k``, s."""
        return float(self.begin[k] - self.begin[k - 1]) if k else 0.0

    def index(self, name: str) -> int:
        """The index of an unknown in ``thetas``, by its name: ``str`` of it."""
        return next(i for i, t in enumerate(self.thetas) if str(t) == name)


@dataclass(frozen=True, slots=True)
class PresentFault:
    """A fault in the equations: the gain ``index`` among the thetas, from ``onset`` s on (the
    drive's start where 0), of a ``size``, in units, at which fits begin; where it ``grows``, as a
    rate times the time since the drive's start does."""

    index: int
    size: float
    onset: float = 0.0
    grows: bool = False

    def put_into(self, problem: Problem) -> Problem:
        """The problem in which it acts from its onset on."""
        if not self.onset:
            return problem
        return beginning_at(problem, self.index, self.onset, grows=self.grows)


def problem_of(
    signals: Signals,
    vehicle: Vehicle,
    effects: Sequence[Effect],
    progress: Progress | None = None,
) -> Problem:
    """The unknowns of one drive, with the gains of ``effects`` among them."""
    return with_fitted_gains(Problem.of(signals, vehicle, effects, progress, input_noise=False))


def blocks_at(
    problem: Problem, present: PresentFault | None = None, progress: Progress | None = None
) -> Blocks:
    """The blocks of the one drive of a ``problem``.

    The equations are linearised at the maximum a posteriori θ of the whole drive, and the
    innovations are extrapolated back to θ = 0, so that each block can be predicted from the blocks
    before alone.  Gains are 0 at the operating point but for that of a fault that is ``present``.
    """
    if present:
        problem = present.put_into(problem)
    readings, thetas = problem.drives[0].readings, problem.thetas
    states = problem.vehicle.machine.states
    wanders = wander(problem.vehicle, problem.compiled.model)
    if not len(readings.t):
        nothing, size = np.zeros(0), 1 + len(thetas)
        gram = np.zeros((0, size, size))
        return Blocks(states, wanders, thetas, nothing, nothing, np.zeros(0, int), nothing, gram)
    if progress:
        progress("linearising", None)
    start = problem.near.copy()
    if present:
        start[present.index] = present.size
    objective, fit = settle(Objective.of(problem), start)
    if present:
        free = np.append(problem.nuisances, present.index)
        fit = most_probable(objective, free, fit.theta)
    fit = fit.as_point
    [rows] = objective.relinearise(fit, fit.theta).raw
    table = np.column_stack([rows.r - rows.psi @ fit.theta, rows.table[:, 1:]])
    if present and present.onset:  # healthy vehicles differ in that gain from the start on
        thetas = (*thetas, thetas[present.index])
        thetas = tuple(_exact(t) if i == present.index else t for i, t in enumerate(thetas))
        table = np.column_stack([table, from_the_start(problem, fit, present.index)])
    statistics = _statistics(readings, replace(rows, table=table), rows.r)
    return Blocks(states, wanders, thetas, *statistics)


def _exact(unknown: Unknown) -> Unknown:
    """The same unknown, alike in all healthy vehicles."""
    return replace(unknown, healthy=0.0) if isinstance(unknown, UnknownGain) else unknown


def _statistics(
    readings: Readings, rows: NormalisedInnovations, at_fit: Floats
) -> tuple[Floats, Floats, NDArray[np.int64], Floats, Floats]:
    """``begin``, ``end``, ``count``, ``off`` and ``gram`` of the blocks of these ``rows``, the
    innovations being ``at_fit`` (K) at the operating point."""
    which, stretches = block_index(readings.t), readings.stretches
    rest, level = _local_residuals(rows, which)
    noise_model = NoiseModel.fit([stretches], [rest * level])
    inlier = np.abs(noise_model.whiten(stretches, rest)) < OUTLIER
    white = noise_model.whiten(stretches, rows.table) * inlier[:, None]
    order = np.argsort(which, kind="stable")
    edges = np.searchsorted(which[order], np.arange(which.max() + 2))
    gram, begin, end, off = [], [], [], []
    for a, b in pairwise(edges.tolist()):
        own = order[a:b]
        gram.append(white[own].T @ white[own])
        off.append(median_std(at_fit[own]))
        begin.append(readings.t[own].min())
        end.append(readings.t[own].max())
    return np.array(begin), np.array(end), np.diff(edges), np.array(off), np.array(gram)


def block_index(t: Floats) -> NDArray[np.int64]:
    """Index of the block (K) of readings at times ``t`` (K) in any order."""
    order = np.argsort(t, kind="stable")
    index, block = np.zeros(len(t), np.int64), 0
    begin = last = t[order[0]]
    for k in order:
        if t[k] - last > PAUSE_S or t[k] - begin > LONGEST_S:
            block, begin = block + 1, t[k]
        index[k], last = block, t[k]
    return index


def _local_residuals(
    rows: NormalisedInnovations, which: NDArray[np.int64]
) -> tuple[Floats, Floats]:
    """Residuals (K) after fitting θ to each stretch of blocks by itself, and the factor (K) that
    makes up for the fitted degrees of freedom: their autocorrelation is that of the noise alone,
    whatever drifts or jumps from stretch to stretch."""
    rest, level = rows.r.copy(), np.ones(len(rows.r))
    for own in np.array_split(np.argsort(which, kind="stable"), max(len(which) // STRETCH, 1)):
        psi = rows.psi[own]
        inner = psi.T @ psi
        weight = np.linalg.inv(inner + np.eye(len(inner)))
        rest[own] -= psi @ (weight @ (psi.T @ rows.r[own]))
        fitted = float(np.trace(weight @ inner))  # effective degrees of freedom
        level[own] = np.sqrt(len(own) / max(len(own) - fitted, 1.0))
    return rest, level
