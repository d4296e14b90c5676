"""Every block predicted from those before: residuals that are white in a healthy truck.

Nuisances (parameters within their spreads, the start, what wanders slowly) are estimated block by
block.  What a block shows beyond their prediction is, in a healthy truck, independent of all that
came before, whichever truck it is (recursive residuals of Brown, Durbin and Evans).  Weighed by a
fault's own trace it is one number of variance 1 per block and fault.

A fault that lasts is taken for a nuisance, little by little, and its trace fades.  Friedland's bias
filter tells by how much: ``absorbed`` is how the estimates answer to one unit of the fault.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clutchest.diagnosis.blocks import Blocks
from clutchest.signals import Floats

# By how much what may wander does so in a healthy truck, in its unit per √h: one standard deviation
# of its first value.
WANDERS: Mapping[str, float] = {"friction": 1.0, "torque_bias": 1.0}
# How far a healthy truck may start from the warmth of coolant and air, K: restarted while its
# clutch is hot, it cools for half an hour, and its zero position moves all that time.
STARTS_HOT: Mapping[str, float] = {"temp_body": 40.0, "temp_housing": 25.0, "temp_disc": 50.0}


@dataclass(frozen=True, slots=True)
class Belief:
    """What the blocks so far say of n nuisances: ``mean`` (n) and ``covariance`` (n, n)."""

    mean: Floats
    covariance: Floats


@dataclass(frozen=True, slots=True)
class Predicted:
    """Residuals of F faults over B blocks.

    ``z`` (B, F) standardised, ``information`` (B, F) of one unit of a fault that begins with the
    block; ``surprise`` (B) the chi-square of the whole block with ``count`` (B) degrees of freedom;
    ``before`` (B) the belief with which each block is met.
    """

    z: Floats
    information: Floats
    surprise: Floats
    count: NDArray[np.int64]
    before: tuple[Belief, ...]


@dataclass(frozen=True, slots=True)
class Since:
    """What B' blocks from an onset on say of F faults that begin there.

    ``score`` (B', F) and ``information`` (B', F, F), summed up: one unit of fault f raises the
    score of fault g by ``information[:, f, g]``.
    """

    score: Floats
    information: Floats


def nuisances(blocks: Blocks) -> tuple[NDArray[np.int64], Floats, Floats]:
    """Indices (n) of what a healthy truck may differ by, prior variances, and what each gains per
    hour (n), all in units."""
    found = [i for i, t in enumerate(blocks.thetas) if not t.exact and (not t.gain or t.healthy)]
    thetas = [blocks.thetas[i] for i in found]
    variance = [
        t.healthy**2
        if t.gain
        else (STARTS_HOT.get(t.key, t.unit) / t.unit) ** 2
        if t.owner == "start"
        else 1.0
        for t in thetas
    ]
    walk = [WANDERS.get(t.key, 0.0) ** 2 if t.owner == "start" else 0.0 for t in thetas]
    return np.array(found, np.int64), np.array(variance), np.array(walk)


def predicted(blocks: Blocks, faults: Sequence[int]) -> Predicted:
    """Residuals of the faults at these indices of ``blocks.thetas``."""
    free, variance, walk = nuisances(blocks)
    n, f = 1 + free, 1 + np.array(faults, np.int64)
    mean, P = np.zeros(len(free)), np.diag(variance)
    z, information = np.zeros((len(blocks), len(f))), np.zeros((len(blocks), len(f)))
    surprise, before = np.zeros(len(blocks)), []
    for k, g in enumerate(blocks.gram):
        P = P + np.diag(walk * blocks.pause(k) / 3600.0)
        before.append(Belief(mean, P))
        A, F = g[np.ix_(n, n)], g[np.ix_(f, n)]
        e_n, e_f = g[n, 0] + A @ mean, g[f, 0] + F @ mean
        after = posterior(P, A)
        told = np.maximum(np.diag(g)[f] - np.einsum("ij,jk,ik->i", F, after, F), 0.0)
        score = F @ (after @ e_n) - e_f
        np.divide(score, np.sqrt(told), out=z[k], where=told > 1e-9)
        information[k] = told
        squares = g[0, 0] + 2.0 * mean @ g[n, 0] + mean @ A @ mean
        surprise[k] = squares - e_n @ after @ e_n
        mean, P = mean - after @ e_n, after
    return Predicted(z, information, surprise, blocks.count, tuple(before))


def since(
    blocks: Blocks, faults: Sequence[int], before: Sequence[Belief], onset: int, until: int
) -> Since:
    """Blocks ``onset`` to ``until`` (exclusive) on faults at these indices of ``blocks.thetas``
    that begin with the first of them; ``before`` as :func:`predicted` gives it."""
    free, _, walk = nuisances(blocks)
    n, f = 1 + free, 1 + np.array(faults, np.int64)
    P, absorbed = before[onset].covariance, np.zeros((len(free), len(f)))
    score = np.zeros((until - onset, len(f)))
    information = np.zeros((until - onset, len(f), len(f)))
    for k in range(onset, until):
        g, mean = blocks.gram[k], before[k].mean
        if k > onset:
            P = P + np.diag(walk * blocks.pause(k) / 3600.0)
        A, F = g[np.ix_(n, n)], g[np.ix_(f, n)]
        after = posterior(P, A)
        # the trace of one unit: its own, and what the estimates made of it before
        traced = F.T + A @ absorbed
        e_n = g[n, 0] + A @ mean
        e_f = g[f, 0] + F @ mean + absorbed.T @ e_n
        inner = g[np.ix_(f, f)] + F @ absorbed + absorbed.T @ F.T + absorbed.T @ A @ absorbed
        score[k - onset] = traced.T @ (after @ e_n) - e_f
        information[k - onset] = inner - traced.T @ after @ traced
        absorbed = absorbed - after @ traced
        P = after
    return Since(np.cumsum(score, axis=0), np.cumsum(information, axis=0))


def posterior(P: Floats, A: Floats) -> Floats:
    """(P⁻¹ + A)⁻¹, symmetric."""
    after = np.linalg.inv(np.linalg.inv(P) + A)
    return (after + after.T) / 2.0
