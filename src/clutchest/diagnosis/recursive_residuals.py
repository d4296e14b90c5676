"""Recursive residuals: each block predicted from those before, white in a healthy vehicle.

Nuisances (parameters within their spreads, initial states, what drifts slowly) are estimated block
by block.  The deviation of a block from its prediction is, in a healthy vehicle, independent of all
blocks before, whatever the nuisances of that vehicle are (recursive residuals of Brown, Durbin and
Evans 1975).  Projected onto a fault's derivatives it is one number of variance 1 per block and
fault.

A persistent fault is gradually absorbed by the nuisance estimates, and its residuals fade.
``absorbed``, the response of the estimates to one unit of the fault, says by how much (Friedland's
bias filter).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clutchest.diagnosis.blocks import Blocks
from clutchest.inference.unknowns import InitialState, StatedGain, Unknown, UnknownGain
from clutchest.models.symbols import State
from clutchest.signals import Floats
from clutchest.vehicle.state_uncertainty import Wander

HOUR = 3600.0  # s
# Of the most that a block of the drive tells of a fault: less is noise of the inputs, of which
# derivatives hold some.  The innovations hold it too, so that it does not look like noise.
FAINT = 1e-3


@dataclass(frozen=True, slots=True)
class PredictedState:
    """Estimate of n nuisances from the blocks before: ``mean`` (n), ``covariance`` (n, n)."""

    mean: Floats
    covariance: Floats


@dataclass(frozen=True, slots=True)
class RecursiveResiduals:
    """Residuals of F faults over B blocks.

    ``z`` (B, F) standardised, 0 where the information is faint; ``information`` (B, F) about one
    unit of a fault that begins with the block; ``chi_square`` (B) of the whole block with ``count``
    (B) degrees of freedom; ``before`` (B) the nuisances predicted for each block.
    """

    z: Floats
    information: Floats
    chi_square: Floats
    count: NDArray[np.int64]
    before: tuple[PredictedState, ...]


@dataclass(frozen=True, slots=True)
class OnsetScores:
    """Cumulative scores of F faults that begin with the first of B' blocks.

    ``score`` (B', F) and ``information`` (B', F, F): one unit of fault f changes the score of fault
    g by ``information[:, f, g]``.
    """

    score: Floats
    information: Floats


def nuisances(
    thetas: Sequence[Unknown], states: Sequence[State], wander: Sequence[Wander] = ()
) -> tuple[NDArray[np.int64], Floats, Floats]:
    """Indices (n) of those of the ``thetas`` in which healthy vehicles differ, their prior
    variances (n) and the increase of these per hour (n), all in units; ``states`` of the machine,
    whose initial values are among the thetas, and how far they ``wander`` by the vehicle's file."""
    known = {state.name: state for state in states}
    initial = [known.get(t.state) if isinstance(t, InitialState) else None for t in thetas]
    variance = np.array([_variance(t, state) for t, state in zip(thetas, initial, strict=True)])
    stated = {each.state: each.density * np.sqrt(HOUR) for each in wander}
    drift = [
        max(state.drift, stated.get(state.name, 0.0) / t.unit) if state else 0.0
        for t, state in zip(thetas, initial, strict=True)
    ]
    per_hour = np.square(drift)
    free = np.flatnonzero(variance)
    return free, variance[free], per_hour[free]


def _variance(unknown: Unknown, state: State | None) -> float:
    """Prior variance in units, 0 of what does not vary; ``state`` whose start it is."""
    match unknown:
        case UnknownGain():
            return unknown.healthy**2
        case StatedGain(exact=True):
            return 0.0
        case InitialState() if state is not None and state.restart_std:
            return (state.restart_std / unknown.unit) ** 2
    return 1.0


def recursive_residuals(blocks: Blocks, faults: Sequence[int]) -> RecursiveResiduals:
    """Residuals of the faults at these indices of ``blocks.thetas``."""
    free, variance, per_hour = nuisances(blocks.thetas, blocks.states, blocks.wander)
    n, f = 1 + free, 1 + np.array(faults, np.int64)
    mean, P = np.zeros(len(free)), np.diag(variance)
    z, information = np.zeros((len(blocks), len(f))), np.zeros((len(blocks), len(f)))
    chi_square, before = np.zeros(len(blocks)), []
    for k, g in enumerate(blocks.gram):
        P = P + np.diag(per_hour * blocks.pause(k) / HOUR)
        before.append(PredictedState(mean, P))
        A, F = g[np.ix_(n, n)], g[np.ix_(f, n)]
        e_n, e_f = g[n, 0] + A @ mean, g[f, 0] + F @ mean
        after = posterior(P, A)
        own = np.maximum(np.diag(g)[f] - np.einsum("ij,jk,ik->i", F, after, F), 0.0)
        score = F @ (after @ e_n) - e_f
        np.divide(score, np.sqrt(own), out=z[k], where=own > 1e-9)
        information[k] = own
        squares = g[0, 0] + 2.0 * mean @ g[n, 0] + mean @ A @ mean
        chi_square[k] = squares - e_n @ after @ e_n
        mean, P = mean - after @ e_n, after
    z[information < FAINT * information.max(axis=0, initial=0.0)] = 0.0
    return RecursiveResiduals(z, information, chi_square, blocks.count, tuple(before))


def onset_scores(
    blocks: Blocks, faults: Sequence[int], before: Sequence[PredictedState], onset: int, until: int
) -> OnsetScores:
    """Scores by blocks ``onset`` to ``until`` (exclusive) of faults at these indices of
    ``blocks.thetas`` that begin with block ``onset``; ``before`` as :func:`recursive_residuals`
    returns it."""
    free, _, per_hour = nuisances(blocks.thetas, blocks.states, blocks.wander)
    n, f = 1 + free, 1 + np.array(faults, np.int64)
    P, absorbed = before[onset].covariance, np.zeros((len(free), len(f)))
    score = np.zeros((until - onset, len(f)))
    information = np.zeros((until - onset, len(f), len(f)))
    for k in range(onset, until):
        g, mean = blocks.gram[k], before[k].mean
        if k > onset:
            P = P + np.diag(per_hour * blocks.pause(k) / HOUR)
        A, F = g[np.ix_(n, n)], g[np.ix_(f, n)]
        after = posterior(P, A)
        # derivative by one unit of the fault: direct, and through the estimates that absorbed it
        shift = F.T + A @ absorbed
        e_n = g[n, 0] + A @ mean
        e_f = g[f, 0] + F @ mean + absorbed.T @ e_n
        inner = g[np.ix_(f, f)] + F @ absorbed + absorbed.T @ F.T + absorbed.T @ A @ absorbed
        score[k - onset] = shift.T @ (after @ e_n) - e_f
        information[k - onset] = inner - shift.T @ after @ shift
        absorbed = absorbed - after @ shift
        P = after
    return OnsetScores(np.cumsum(score, axis=0), np.cumsum(information, axis=0))


def posterior(P: Floats, A: Floats) -> Floats:
    """(P⁻¹ + A)⁻¹, symmetric."""
    after = np.linalg.inv(np.linalg.inv(P) + A)
    return (after + after.T) / 2.0
