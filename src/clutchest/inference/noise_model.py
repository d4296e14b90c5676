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
FEWEST = 60  # readings from which a group's model is its own; with fewer, white
SENSOR = 64  # groups of one sensor are numbered from its own number times this on
TAIL = 5.0  # standard deviations
SLOWEST = 0.999  # reflection coefficient
OF_STRETCH = (
    10.0  # readings for each of memory, where stretches have fewer than FEWEST in the mean:
)
# else what comes again in every one, as errors of the equations do, passes for noise with lines
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
        group = sensor.astype(np.int64) * SENSOR + row
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
        """From what is left of innovations (K) of each drive; as much memory as Akaike's criterion
        and the length of stretches allow, the ``longest`` at most: white with 0."""
        tamed = [_tamed(e, s.group) for s, e in zip(stretches, residuals, strict=True)]
        return cls.of_columns(stretches, [e[:, None] for e in tamed], np.ones(1), longest)

    @classmethod
    def of_columns(
        cls,
        stretches: Sequence[Stretches],
        columns: Sequence[Floats],
        counts: Floats,
        longest: int = ORDER,
    ) -> NoiseModel:
        """From columns (K, D) of each drive, each of which ``counts`` (D) so many times; a column
        that is taken away counts less than 0.

        By Burg's method over all stretches of a group (S. de Waele, P. Broersen, The Burg algorithm
        for segments, IEEE Trans. Signal Processing 48, 2000): a product counts against the squares
        of the same two.  Against those of all readings, of which the first of a stretch have no
        partner, slow noise seems less slow than it is, and what is left of it louder.
        """
        own = np.concatenate([s.group for s in stretches])
        groups, of = np.unique(own, return_inverse=True)
        place = np.concatenate([s.place for s in stretches])
        forward = np.concatenate(columns).astype(np.float64)
        shape = len(groups), ORDER + 1
        power, pairs, reflection = np.zeros(len(groups)), np.zeros(shape), np.zeros(shape)
        _burg(forward, forward.copy(), of, place, counts, power, pairs, reflection)
        power = _of_few(power, pairs[:, 0], groups // SENSOR)
        weights, level = np.zeros((*shape, ORDER)), np.ones(shape)
        for i, own_pairs in enumerate(pairs):
            mean = own_pairs[0] / max(own_pairs[0] - own_pairs[1], 1.0)
            most = longest if mean >= FEWEST else max(int(mean / OF_STRETCH), 1)
            order = min(longest, most) if own_pairs[0] >= FEWEST else 0
            weights[i], level[i] = _predictions(power[i], own_pairs, reflection[i], order)
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


def _of_few(power: Floats, count: Floats, sensor: NDArray[np.int64]) -> Floats:
    """Mean square (G) of groups with a ``power`` (G) of so many readings ``count`` (G): what they
    lack of FEWEST counts as the other readings of their ``sensor`` (G) do, and what all of a
    sensor lack as stated, 1.  One reading alone may lie as near 0 as it likes."""
    out = power.copy()
    for one in np.unique(sensor):
        own = sensor == one
        readings = count[own].sum()
        lack = max(FEWEST - readings, 0.0)
        of_sensor = (max(power[own] @ count[own], 0.0) + lack) / (readings + lack)
        lacking = np.maximum(FEWEST - count[own], 0.0)
        out[own] = (power[own] * count[own] + lacking * of_sensor) / (count[own] + lacking)
    return out


def _predictions(
    power: float, pairs: Floats, reflection: Floats, longest: int
) -> tuple[Floats, Floats]:
    """Predictions of every order up to the best, and their standard deviations, by Levinson's
    recursion: of noise of this ``power``, with a ``reflection`` (ORDER + 1) of every order, known
    from so many ``pairs`` (ORDER + 1)."""
    weights, variance = np.zeros((ORDER + 1, ORDER)), np.full(ORDER + 1, max(power, 1e-12))
    if power <= 0.0:
        return weights, np.ones(ORDER + 1)
    a, criterion = np.zeros(0), np.zeros(longest + 1)
    for q in range(1, longest + 1):
        a = np.append(a - reflection[q] * a[::-1], reflection[q])
        weights[q, :q] = a
        variance[q] = variance[q - 1] * (1.0 - reflection[q] ** 2)
        known = pairs[q] if pairs[q] >= FEWEST / 2 else 0.0
        criterion[q] = criterion[q - 1] + known * np.log(1.0 - reflection[q] ** 2) + 2.0
    best = int(np.argmin(criterion))
    weights[best:], variance[best:] = weights[best], variance[best]
    return weights, np.sqrt(variance)


@compiled
def _burg(
    forward: Floats,
    backward: Floats,
    of: NDArray,
    place: NDArray,
    counts: Floats,
    power: Floats,
    pairs: Floats,
    reflection: Floats,
) -> None:
    """The mean square ``power`` (G) of readings, both of which ``forward`` and ``backward`` (K, D)
    begin as, the reflection coefficients (G, ORDER + 1) of every order, and of how many ``pairs``
    each is; ``forward`` and ``backward`` end as what the last order leaves."""
    for k in range(len(of)):
        pairs[of[k], 0] += 1.0
        for c in range(forward.shape[1]):
            power[of[k]] += counts[c] * forward[k, c] ** 2
    for g in range(len(power)):
        power[g] /= max(pairs[g, 0], 1.0)
    for q in range(1, pairs.shape[1]):
        square = np.zeros(len(power))
        for k in range(len(of)):
            if place[k] >= q:
                pairs[of[k], q] += 1.0
                for c in range(forward.shape[1]):
                    now, before = forward[k, c], backward[k - 1, c]
                    reflection[of[k], q] += counts[c] * now * before
                    square[of[k]] += counts[c] * (now**2 + before**2) / 2.0
        for g in range(len(square)):
            if square[g] > 0.0:
                reflection[g, q] = min(max(reflection[g, q] / square[g], -SLOWEST), SLOWEST)
            else:
                reflection[g, q] = 0.0
        for k in range(len(of) - 1, -1, -1):  # those before stand as they were
            if place[k] >= q:
                r = reflection[of[k], q]
                for c in range(forward.shape[1]):
                    now, before = forward[k, c], backward[k - 1, c]
                    forward[k, c] = now - r * before
                    backward[k, c] = before - r * now


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
