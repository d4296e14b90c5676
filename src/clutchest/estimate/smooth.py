"""Estimates from the whole drive: the fixed-interval smoother, in bounded memory.

Kept from the way forward is one belief per window of events.  The way back filters each window
again from there and smooths it, so that memory holds one window, whatever the length of the log.

The parameters are unknown too.  With θ at its nominal value the filter leaves innovations ν whose
response to θ is its signature; they are linear in θ, and white at the true one.  So the whole log
has told of θ (Friedland's separate-bias estimation, IEEE Trans. AC-14, 1969)

    C = (Θ⁻¹ + Σ σσᵀ/s)⁻¹,  θ̂ = −C Σ σν/s        σ = ∂ν/∂θ, s variance of ν, Θ the squared spreads

and with the smoothed state's own response S to θ the state is x + S θ̂, its covariance P + S C Sᵀ:
the optimum over state and parameters together, at the price of the state alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from clutchest.estimate.timeline import Timeline
from clutchest.estimate.whole_log import Belief, Compiled, Filtered, Progress
from clutchest.signals import Floats

WINDOW = 8192  # events that are in memory at once


@dataclass(frozen=True, slots=True)
class Smoothed:
    """``x`` (r, n) and ``P`` (r, n, n), the parameters' uncertainty included, on the grid."""

    x: Floats
    P: Floats


def smooth(
    compiled: Compiled,
    timeline: Timeline,
    start: Belief,
    filtered: Filtered,
    progress: Progress | None = None,
) -> Smoothed:
    """Smooth one timeline from ``start``, over the regular grid.

    ``filtered`` is what the filter made of it: a measurement that it took for an outlier counts
    here for as little.
    """
    K, n, m = len(timeline.t), len(start.x), len(compiled.thetas)
    begins = range(0, K, WINDOW)
    size = min(WINDOW, K) + 1
    on_grid = np.zeros(K, bool)
    on_grid[timeline.emit >= 0] = timeline.grid
    buffer = (np.zeros((size, n, n)), np.zeros((size, n)), np.zeros((size, n)), np.ones(size),
              np.zeros((size, 1 + m)))  # fmt: skip
    of_rows = np.zeros((size, n, 1 + m)), np.zeros((size, n, n))

    def window(begin: int) -> tuple[slice, np.ndarray, np.ndarray]:
        # a window starts with the event before it, which has been taken already
        piece = slice(max(begin - 1, 0), min(begin + WINDOW, K))
        sensor, out = timeline.sensor[piece].copy(), on_grid[piece].copy()
        if begin:
            sensor[0], out[0] = -1, False
        return piece, sensor, np.where(out, np.cumsum(out) - 1, -1)

    def remember(begin: int, belief: Belief) -> None:
        piece, sensor, emit = window(begin)
        raised = filtered.innovation[piece, 2] - filtered.innovation[piece, 1]
        compiled.functions.remember(
            belief.x, belief.P, belief.S, timeline.t[piece], sensor, timeline.z[piece],
            timeline.R[piece] + raised, timeline.u[piece], timeline.row[piece], timeline.W,
            timeline.Q, timeline.longest, timeline.noise, compiled.p, compiled.g, emit,
            *buffer, *of_rows,
        )  # fmt: skip

    def tell(share: float) -> None:
        if progress:
            progress("smoothing", share)

    belief, checkpoints = start.copy(), []
    squares = np.zeros((1 + m, 1 + m))
    for begin in begins:
        tell(0.5 * begin / K)
        checkpoints.append(belief.copy())
        remember(begin, belief)
        _, sensor, _ = window(begin)
        seen = np.flatnonzero(sensor >= 0)
        told = buffer[4][seen]
        squares += told.T @ (told / buffer[3][seen, None])
    theta, C = _parameters(squares, compiled.spread)

    L, A = np.zeros((n, 1 + m)), np.zeros((n, n))
    rows = int(on_grid.sum())
    x, P = np.empty((rows, n)), np.empty((rows, n, n))
    for begin in reversed(begins):
        tell(1.0 - 0.5 * begin / K)
        remember(begin, checkpoints.pop())
        piece, sensor, emit = window(begin)
        compiled.functions.look_back(L, A, timeline.t[piece], sensor, emit, *buffer, *of_rows)
        count = int(emit.max(initial=-1)) + 1
        X, own = of_rows[0][:count], of_rows[1][:count]
        S = X[:, :, 1:]
        x[rows - count : rows] = X[:, :, 0] + S @ theta
        P[rows - count : rows] = own + S @ C @ S.transpose(0, 2, 1)
        rows -= count
    return Smoothed(x, P)


def _parameters(squares: Floats, spread: Floats) -> tuple[Floats, Floats]:
    """θ̂ (m) and its covariance (m, m) from ``squares`` (1 + m, 1 + m): Σ of the products of
    innovation and signature over the variance.  In units of the spread, which may be 0."""
    information = np.eye(len(spread)) + spread[:, None] * squares[1:, 1:] * spread
    C = spread[:, None] * np.linalg.inv(information) * spread
    return -C @ squares[1:, 0], C
