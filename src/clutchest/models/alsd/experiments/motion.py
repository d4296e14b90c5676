"""Position, speed and acceleration from the samples of an angle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from clutchest.signals import Floats, Signal

SLOW = 1.5  # s, over which a motor that runs alone changes its temperature by next to nothing


def local_polynomial(time: Floats, value: Floats, count: int, order: int) -> Floats:
    """Value, slope and second derivative (n, 3) at every sample (n) by a polynomial of that
    ``order`` through the ``count`` samples about it, an odd number; at both ends through the first
    and last ones.  Samples may lie unevenly."""
    weights = polynomial_weights(time, count, order)
    first = np.clip(np.arange(len(time)) - count // 2, 0, len(time) - count)
    return np.einsum("nik,nk->ni", weights, sliding_window_view(value, count)[first])


def polynomial_weights(time: Floats, count: int, order: int) -> Floats:
    """What :func:`local_polynomial` takes of each of the samples (n, 3, count)."""
    if len(time) < count:
        raise ValueError("fewer samples than a polynomial takes")
    half = count // 2
    first = np.clip(np.arange(len(time)) - half, 0, len(time) - count)
    about = sliding_window_view(time, count)[first] - time[:, None]
    reach = np.abs(about).max(axis=1)
    basis = (about / reach[:, None])[:, :, None] ** np.arange(order + 1)
    normal = np.einsum("nki,nkj->nij", basis, basis)
    weights = np.linalg.solve(normal, np.swapaxes(basis, 1, 2))[:, :3]
    scale = np.stack([np.ones_like(reach), 1 / reach, 2 / reach**2], axis=1)
    return np.asarray(weights * scale[:, :, None])


def second_derivative_std(period: float, count: int, order: int) -> float:
    """Standard deviation of :func:`local_polynomial`'s second derivative, for samples a ``period``
    of s apart with noise of 1."""
    time = period * (np.arange(count) - count // 2)
    basis = time[:, None] ** np.arange(order + 1)
    return 2.0 * float(np.sqrt(np.linalg.inv(basis.T @ basis)[2, 2]))


@dataclass(frozen=True, slots=True)
class Polynomial:
    """A polynomial in time through a span's samples: coefficients and their covariance for samples
    with noise of 1, of powers of the time from ``middle`` over ``reach`` s."""

    middle: float
    reach: float
    coefficients: Floats
    covariance: Floats

    @classmethod
    def through(cls, signal: Signal, start: float, end: float, order: int) -> Polynomial:
        """Least squares through the samples in ``start`` … ``end``, s."""
        rows = slice(*np.searchsorted(signal.time, (start, end)))
        middle, reach = (start + end) / 2, (end - start) / 2
        basis = ((signal.time[rows] - middle) / reach)[:, None] ** np.arange(order + 1)
        covariance = np.asarray(np.linalg.inv(basis.T @ basis), np.float64)
        return cls(middle, reach, covariance @ basis.T @ signal.value[rows], covariance)

    def derivative(self, time: Floats, by: int) -> tuple[Floats, Floats]:
        """The ``by``-th derivative at ``time`` (k,), and its covariance (k, k) for noise of 1."""
        x = (time - self.middle) / self.reach
        rows = np.zeros((len(time), len(self.coefficients)))
        for power in range(by, len(self.coefficients)):
            factor = np.prod(np.arange(power - by + 1, power + 1)) if by else 1.0
            rows[:, power] = factor * x ** (power - by) / self.reach**by
        return rows @ self.coefficients, rows @ self.covariance @ rows.T


def mean_about(signal: Signal, time: float) -> float:
    """Mean of the samples of a slow signal about a ``time``, s."""
    rows = slice(*np.searchsorted(signal.time, (time - SLOW, time + SLOW)))
    return (
        float(np.mean(signal.value[rows]))
        if rows.stop > rows.start
        else float(signal.at(np.array([time]))[0])
    )


def window_means(signal: Signal, edges: Floats) -> tuple[Floats, Floats]:
    """Values in the middle between successive ``edges`` (k + 1,) by the means of the samples there,
    NaN where there are none, and how many each has.

    Means are moved along by their own slope: samples of two signals do not lie alike.
    """
    cuts = np.searchsorted(signal.time, edges)
    count = np.diff(cuts).astype(np.float64)
    some = np.where(count > 0, count, np.nan)
    time, value = (
        np.diff(np.concatenate([[0.0], np.cumsum(column)])[cuts]) / some
        for column in (signal.time - edges[0], signal.value)
    )
    known = np.isfinite(value)
    if known.sum() > 2:
        middle = (edges[:-1] + edges[1:])[known] / 2 - edges[0]
        value[known] += np.gradient(value[known], time[known]) * (middle - time[known])
    return value, count
