"""By how much noise shifts what is fitted, where it is in innovations and in derivatives alike.

Where states are tracked throughout, noise of an input moves them, so that derivatives hold a trace
of the noise that innovations are made of.  Where several unknowns can hardly be told apart, what
tells them apart is as small as this trace.  As much noise again, drawn and put on the readings,
changes innovations and derivatives; what these two changes have in common, the noise that is there
made them have in common too (Cook and Stefanski 1994).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from clutchest.inference.innovations import NormalisedInnovations
from clutchest.inference.linear_solve import solved
from clutchest.inference.map_fit import curvature
from clutchest.inference.objective import Objective
from clutchest.inference.prepared_drive import Readings
from clutchest.inference.problem import INDEPENDENT, Problem
from clutchest.inference.white_linearisation import Linearisation
from clutchest.recursion import recur
from clutchest.signals import Floats, Signals
from clutchest.vehicle import Vehicle

SEED = 7
TINY = 1e-300


def with_noise_again(problem: Problem, signals: Signals) -> Problem:
    """The same of ``signals``, its drives, with noise once more."""
    rng = np.random.default_rng(SEED)
    drives = [noisier(drive, problem.vehicle, rng) for drive in signals.drives]
    return problem.once_more(drives)


def noisier(drive: Signals, vehicle: Vehicle, rng: np.random.Generator) -> Signals:
    """One drive with as much noise once more as the vehicle file states."""
    signals = dict(drive.signals)
    for name, signal in drive.signals.items():
        if name in vehicle.signals:
            stated = vehicle.signals[name]
            white = rng.standard_normal(len(signal.value))
            white[1:] *= np.sqrt(1.0 - stated.noise_ar**2)
            noise = stated.noise * recur(white, stated.noise_ar)
            signals[name] = replace(signal, value=signal.value + noise)
    return replace(drive, signals=signals, later=())


def noise_bias(
    objective: Objective, again: Problem, lin: Linearisation, free: NDArray[np.int64]
) -> tuple[Floats, Floats]:
    """By how much the ``free`` thetas of a fit are too large, ``lin`` with their derivatives, and
    the standard deviation of that, as it scatters from block to block: (m) each.  What is no more
    than this scatter is none.  ``again``: the same drives with noise once more."""
    once = objective.problem.linearise(lin.theta, lin.shapes, free, lin.implied)
    twice = again.linearise(lin.theta, lin.shapes, free)
    drives = zip(objective.problem.drives, again.drives, strict=True)
    same = [_same(a.readings, b.readings) for a, b in drives]
    tables = zip(same, once, twice, strict=True)
    changes = objective.whiten([_changes(which, a, b, free) for which, a, b in tables])
    blocks = objective.problem.blocks(INDEPENDENT)
    common = np.zeros((int(blocks.max()) + 1, len(free)))
    np.add.at(common, blocks, changes[:, 1:] * changes[:, :1])
    each = -solved(curvature(objective, lin, free), common.T)
    total, variance = each.sum(1), each.var(1) * each.shape[1]
    bias, std = np.zeros((2, len(lin.theta)))
    if not np.isfinite(total).all():  # the equations run away there
        return bias, std
    bias[free] = total * np.maximum(1.0 - variance / np.maximum(total**2, TINY), 0.0)
    std[free] = np.sqrt(variance)
    return bias, std


def _changes(
    same: tuple[NDArray[np.int64], NDArray[np.int64]],
    before: NormalisedInnovations,
    after: NormalisedInnovations,
    free: NDArray[np.int64],
) -> Floats:
    """Of innovations (K), and of their derivatives by the ``free`` thetas (f): (K, 1 + f); none of
    readings that are not the ``same`` after as ``before``, as noise may choose."""
    first, second = same
    changes = np.zeros((len(before.r), 1 + len(free)))
    changes[first, 0] = after.r[second] - before.r[first]
    changes[first, 1:] = after.psi[np.ix_(second, free)] - before.psi[np.ix_(first, free)]
    return changes


def _same(readings: Readings, others: Readings) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Indices of readings that are among the others, and where these stand there."""
    end = 1.0 + max(readings.t.max(initial=0.0), others.t.max(initial=0.0))
    keys = [each.sensor * end + each.t for each in (readings, others)]
    _, first, second = np.intersect1d(*keys, return_indices=True)
    return first, second
