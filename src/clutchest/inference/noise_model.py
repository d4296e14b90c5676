"""The autocorrelation and level of innovations: noise, when all that is known is taken out.

Innovations of one sensor in one regime are taken for an autoregressive process; dividing that out
makes them white, and their derivatives comparable with them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import prod

import numpy as np
from numpy.typing import NDArray

from clutchest.native import compiled
from clutchest.signals import Floats

ORDER = 12  # longest memory tried, samples
FEWEST = 60  # readings from which a model is made; below, white with the sensor's own level
TAIL = 5.0  # standard deviations
GAP = 3.0  # sample periods; a longer gap begins a new stretch


@dataclass(frozen=True, slots=True)
class Stretches:
    """How the readings of a drive hang together: ``group`` (K) sensor and regime as one number,
    ``place`` (K) the number of readings before it in its stretch without gaps."""

    group: NDArray[np.int64]
    place: NDArray[np.int64]

    @classmethod
    def of(cls, t: Floats, sensor: NDArray, row: NDArray) -> Stretches:
        """From readings sorted by sensor, then time."""
        group = sensor.astype(np.int64) * 64 + row
        place = np.zeros(len(t), np.int64)
        if len(t) < 2:
            return cls(group, place)
        step = np.diff(t)
        together = np.diff(group) == 0
        for which in np.unique(group):
            inside = together & (group[1:] == which)
            if inside.any():
                together &= ~inside | (step <= GAP * np.median(step[inside]))
        _count(together, place)
        return cls(group, place)


@compiled
def _count(together: NDArray, place: NDArray) -> None:
    for k in range(len(together)):
        place[k + 1] = place[k] + 1 if together[k] else 0


@dataclass(frozen=True, slots=True)
class NoiseModel:
    """Autoregressive noise of every group.

    ``groups`` (G) as :class:`Stretches` numbers them; ``weights`` (G, ORDER + 1, ORDER): the best
    prediction from the last q readings, q = 0…ORDER; ``level`` (G, ORDER + 1) its standard
    deviation.
    """

    groups: NDArray[np.int64]
    weights: Floats
    level: Floats

    @classmethod
    def white(cls, stretches: Sequence[Stretches]) -> NoiseModel:
        """White noise of unit variance: innovations as they come."""
        groups = np.unique(np.concatenate([s.group for s in stretches]))
        shape = len(groups), ORDER + 1
        return cls(groups, np.zeros((*shape, ORDER)), np.ones(shape))

    @classmethod
    def fit(
        cls, stretches: Sequence[Stretches], residuals: Sequence[Floats], longest: int = ORDER
    ) -> NoiseModel:
        """From what is left of innovations (K) of each drive, by Levinson's recursion on their
        autocovariances; as much memory as Akaike's criterion allows, the ``longest`` at most:
        white with 0."""
        tamed = [_tamed(e, s.group) for s, e in zip(stretches, residuals, strict=True)]
        groups = np.unique(np.concatenate([s.group for s in stretches]))
        return cls.of_sums(groups, *sums(stretches, tamed), longest)

    @classmethod
    def of_sums(
        cls, groups: NDArray[np.int64], lagged: Floats, count: Floats, longest: int = ORDER
    ) -> NoiseModel:
        """From ``lagged`` (G, ORDER + 1) sums of products and the ``count`` (G) of residuals."""
        weights = np.zeros((len(groups), ORDER + 1, ORDER))
        level = np.ones((len(groups), ORDER + 1))
        for i, n in enumerate(count):
            order = longest if n >= FEWEST else 0
            weights[i], level[i] = _levinson(lagged[i] / max(n, 1), order, int(n))
        return cls(groups, weights, level)

    def whiten(self, s: Stretches, values: Floats) -> Floats:
        """``values`` (K, …) less what the readings before them predict, over its deviation."""
        out = values.copy()
        self.whiten_in_place(s, out)
        return out

    def whiten_in_place(self, s: Stretches, values: Floats) -> None:
        """The same where ``values``, C-ordered, are no longer needed."""
        of = np.searchsorted(self.groups, s.group)
        table = values.reshape(len(values), prod(values.shape[1:]))
        _whiten(table, of, s.place, self.weights, self.level)

    def coloured(self, s: Stretches, white: Floats) -> Floats:
        """What :meth:`whiten` makes ``white`` (K, …)."""
        out = np.ascontiguousarray(white, np.float64).copy()
        of = np.searchsorted(self.groups, s.group)
        _colour(out.reshape(len(out), prod(out.shape[1:])), of, s.place, self.weights, self.level)
        return out


def median_std(errors: Floats) -> float:
    """Standard deviation of normal ``errors`` (n) by their median size, to which a few that lie far
    off do nothing."""
    return 1.4826 * float(np.median(np.abs(errors)))


def _tamed(e: Floats, group: NDArray[np.int64]) -> Floats:
    """``e`` with what lies far off in its group, by the median's measure, brought near: an outlier
    says nothing of autocorrelation."""
    near = e.copy()
    for which in np.unique(group):
        rows = group == which
        scale = median_std(e[rows])
        if scale > 0.0:
            near[rows] = np.clip(e[rows], -TAIL * scale, TAIL * scale)
    return near


def sums(stretches: Sequence[Stretches], errors: Sequence[Floats]) -> tuple[Floats, Floats]:
    """Of ``errors`` (K) or several columns of them (K, D), in their mean: Σ e_k e_{k−lag} within
    the stretches of each group, lags 0…ORDER (G, ORDER + 1), and the number of readings (G)."""
    groups = np.unique(np.concatenate([s.group for s in stretches]))
    lagged, count = np.zeros((len(groups), ORDER + 1)), np.zeros(len(groups))
    for s, e in zip(stretches, errors, strict=True):
        of = np.searchsorted(groups, s.group)
        table = np.ascontiguousarray(e, np.float64).reshape(len(e), prod(e.shape[1:]))
        count += np.bincount(of, minlength=len(groups))
        own = np.zeros_like(lagged)
        _lagged(table, of, s.place, own)
        lagged += own / table.shape[1]
    return lagged, count


def _levinson(covariance: Floats, longest: int, count: int) -> tuple[Floats, Floats]:
    """Predictions of every order up to the best, and their standard deviations."""
    weights, variance = np.zeros((ORDER + 1, ORDER)), np.zeros(ORDER + 1)
    variance[:] = max(covariance[0], 1e-12)
    if covariance[0] <= 0.0:
        return weights, np.ones(ORDER + 1)
    a = np.zeros(0)
    for q in range(1, longest + 1):
        reflection = (covariance[q] - a @ covariance[q - 1 : 0 : -1]) / variance[q - 1]
        reflection = float(np.clip(reflection, -0.999, 0.999))
        a = np.append(a - reflection * a[::-1], reflection)
        weights[q, :q] = a
        variance[q] = variance[q - 1] * (1.0 - reflection**2)
    criterion = count * np.log(variance[: longest + 1]) + 2.0 * np.arange(longest + 1)
    best = int(np.argmin(criterion))
    weights[best:], variance[best:] = weights[best], variance[best]
    return weights, np.sqrt(variance)


@compiled
def _lagged(errors: Floats, of: NDArray, place: NDArray, lagged: Floats) -> None:
    longest = lagged.shape[1] - 1
    for k in range(len(errors)):
        for lag in range(min(place[k], longest) + 1):
            total = 0.0
            for c in range(errors.shape[1]):
                total += errors[k, c] * errors[k - lag, c]
            lagged[of[k], lag] += total


@compiled
def _whiten(values: Floats, of: NDArray, place: NDArray, weights: Floats, level: Floats) -> None:
    order = weights.shape[2]
    for k in range(len(values) - 1, -1, -1):  # those before stand as they were
        q = min(place[k], order)
        scale = 1.0 / level[of[k], q]
        for i in range(q):
            w = weights[of[k], q, i]
            if w != 0.0:
                for c in range(values.shape[1]):
                    values[k, c] -= w * values[k - 1 - i, c]
        for c in range(values.shape[1]):
            values[k, c] *= scale


@compiled
def _colour(values: Floats, of: NDArray, place: NDArray, weights: Floats, level: Floats) -> None:
    order = weights.shape[2]
    for k in range(len(values)):  # those before are coloured
        q = min(place[k], order)
        for c in range(values.shape[1]):
            values[k, c] *= level[of[k], q]
        for i in range(q):
            w = weights[of[k], q, i]
            if w != 0.0:
                for c in range(values.shape[1]):
                    values[k, c] += w * values[k - 1 - i, c]
