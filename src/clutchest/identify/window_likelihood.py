"""Restricted likelihood of windows: a straight line, random walk of its slope, AR(1) noise.

Second differences of a window are free of any straight line.  In them the walk is white, and
whatever is stationary stays so: their covariance is the fourth difference of the noise's
autocovariance (a Toeplitz matrix) plus the walk's variance on the diagonal.  A sample that is
missing is integrated over, by its row of the precision matrix.  Compiled, because the many small
matrices are too small for a threaded library.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from clutchest.native import compiled
from clutchest.signals import Floats

SECOND = np.array([1.0, -2.0, 1.0])  # weights of a second difference


def toeplitz_row(autocovariance: Floats) -> Floats:
    """Autocovariance of second differences at lags 0 … n−3, from that of the n readings."""
    c = np.concatenate([autocovariance[2:0:-1], autocovariance])  # from lag −2 on
    n = len(autocovariance)
    return np.convolve(c, [1.0, -4.0, 6.0, -4.0, 1.0], mode="valid")[: n - 2]


@compiled
def factor(row: Floats, walk: float) -> Floats:
    """Lower Cholesky factor of the covariance of second differences, shape (n−2, n−2)."""
    n = len(row)
    lower = np.zeros((n, n))
    for i in range(n):
        for j in range(i + 1):
            value = row[i - j]
            if i == j:
                value += walk * walk
            for k in range(j):
                value -= lower[i, k] * lower[j, k]
            lower[i, j] = np.sqrt(max(value, 1e-300)) if i == j else value / lower[j, j]
    return lower


@compiled
def whiten(lower: Floats, columns: Floats) -> Floats:
    """lower⁻¹ · columns."""
    white = columns.copy()
    for i in range(len(lower)):
        for j in range(i):
            weight = lower[i, j]
            for w in range(white.shape[1]):
                white[i, w] -= weight * white[j, w]
        scale = 1.0 / lower[i, i]
        for w in range(white.shape[1]):
            white[i, w] *= scale
    return white


@compiled
def _differences(n: int) -> Floats:
    """The matrix (n−2, n) of second differences."""
    matrix = np.zeros((n - 2, n))
    for i in range(n - 2):
        for k in range(3):
            matrix[i, i + k] = SECOND[k]
    return matrix


@compiled
def _of_missing(half: Floats, white: Floats, missing: NDArray[np.bool_]) -> float:
    """What integrating over the missing samples of one window adds to −2 log likelihood."""
    places, m, n = np.zeros(len(missing), np.int64), 0, len(half)
    for k in range(len(missing)):
        if missing[k]:
            places[m] = k
            m += 1
    block, side = np.zeros((m, m)), np.zeros(m)
    for a in range(m):
        for k in range(n):
            side[a] += half[k, places[a]] * white[k]
        for b in range(a + 1):
            for k in range(n):
                block[a, b] += half[k, places[a]] * half[k, places[b]]
    added = 0.0
    for i in range(m):  # Cholesky of the block, and the side whitened by it, in place
        for j in range(i + 1):
            for k in range(j):
                block[i, j] -= block[i, k] * block[j, k]
            block[i, j] = np.sqrt(max(block[i, i], 1e-300)) if i == j else block[i, j] / block[j, j]
        for k in range(i):
            side[i] -= block[i, k] * side[k]
        side[i] /= block[i, i]
        added += 2.0 * np.log(block[i, i]) - side[i] * side[i]
    return added


@compiled
def table(
    row: Floats, walk_strengths: Floats, second: Floats, missing: NDArray[np.bool_]
) -> Floats:
    """−2 log likelihood (W, len(walk_strengths)) of windows, a constant left out.

    ``row`` as of :func:`toeplitz_row`; ``walk_strengths``: standard deviation of the slope's
    steps; ``second`` (n−2, W) second differences of the readings, any number in place of missing
    ones; ``missing`` (W, n) True where a sample is missing.
    """
    count = second.shape[1]
    result = np.empty((count, len(walk_strengths)))
    any_missing, some = np.zeros(count, np.bool_), False
    for w in range(count):
        for k in range(missing.shape[1]):
            any_missing[w] |= missing[w, k]
        some = some or any_missing[w]
    differences = _differences(missing.shape[1])
    for d in range(len(walk_strengths)):
        lower = factor(row, walk_strengths[d])
        white = whiten(lower, second)
        constant = 0.0
        for k in range(len(lower)):
            constant += 2.0 * np.log(lower[k, k])
        half = whiten(lower, differences) if some else differences
        for w in range(count):
            value = constant
            for k in range(len(white)):
                value += white[k, w] * white[k, w]
            if any_missing[w]:
                value += _of_missing(half, white[:, w], missing[w])
            result[w, d] = value
    return result
