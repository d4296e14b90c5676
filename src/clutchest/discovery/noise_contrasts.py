"""Contrasts of noise: whether residuals of one sensor are of the same kind everywhere.

What a sensor's noise is like, its level, colour and tails, is its own business and estimated; that
it differs from one regime to another, or late in a regime's intervals from early in them, or in the
second half of the data from the first, is not.  Windows of residuals are compared by Welch's
statistic; under the null they are exchangeable, so its distribution is that over permutations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtr

from clutchest.discovery.residual_series import ResidualSeries
from clutchest.inference.noise_model import NoiseModel, Stretches
from clutchest.signals import Floats

WINDOW = 32  # residuals
FEWEST = 8  # windows on each side of a contrast
ROUNDED = 0.05  # of the noise's variance: more of it is rounding of readings that come in steps
ALIKE = 0.05  # of a level: no better is computed how loud two regimes should be
LOWEST = 2  # bin of a window's spectrum: below, its mean has been taken out
NORMALISING = 1.0 / 3.0  # power that makes a chi-square variate nearly normal (Wilson, Hilferty)
SHORT = np.float32  # of permuted tables
BATCH = 2**22  # entries of permuted tables at a time
REGIME, LATE, SECOND = "regime", "late", "second"  # what is compared


@dataclass(frozen=True, slots=True)
class Measures:
    """Of windows (W) of residuals: ``values`` (W, k), each of which is of a ``kinds`` (k); of a
    spectrum, the ``bin`` (k), 0 of all others."""

    values: Floats
    kinds: tuple[str, ...]
    bin: NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class TwoSides:
    """Windows (W) on one ``side`` and on the ``other`` of a contrast of ``what``, in a ``mode``."""

    what: str
    mode: int
    side: NDArray[np.bool_]
    other: NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Contrasts:
    """Contrasts of one sensor over ``parts`` (P) of its ``measures`` (k).

    ``difference`` (P, k) of the means of both sides, ``log_p`` (P, k) the logarithm of the p-value
    of each by itself, ``null`` (draws, P, k) the same of windows that are permuted.
    """

    parts: tuple[TwoSides, ...]
    measures: Measures
    difference: Floats
    log_p: Floats
    null: Floats


def contrasts(series: ResidualSeries, draws: int, rng: np.random.Generator) -> Contrasts | None:
    """Those of a sensor; None where it has too few residuals to compare, or where they depend on
    where a value lies between two steps of its readings."""
    if series.rounding > ROUNDED:
        return None
    begins, late = windows(series.place, WINDOW)
    mode = series.mode[begins]
    parts = tuple(p for p in _parts(mode, late) if min(p.side.sum(), p.other.sum()) >= FEWEST)
    if not parts:
        return None
    measures = _measures(series, begins)
    values = measures.values - measures.values.mean(axis=0)
    sides = np.array([[p.side, p.other] for p in parts], float)  # (P, 2, W)
    alike = np.where(np.array(measures.kinds) == "level", 2.0 * np.log1p(ALIKE), 0.0)
    difference, log_p = _welch(sides, values, alike)
    null, short, short_values = (
        np.zeros((draws, *log_p.shape)),
        sides.astype(SHORT),
        values.astype(SHORT),
    )
    each = max(BATCH // sides.size, 1)
    for begin in range(0, draws, each):
        count = min(each, draws - begin)
        order = rng.permuted(np.tile(np.arange(len(begins)), (count, 1)), axis=1)
        permuted = np.moveaxis(short[..., order], 2, 0)
        null[begin : begin + count] = _welch(permuted, short_values, alike)[1]
    return Contrasts(parts, measures, difference, log_p, null)


def windows(place: NDArray[np.int64], size: int) -> tuple[NDArray[np.int64], Floats]:
    """Where windows of ``size`` residuals begin (W), the last of each interval ending with it; and
    whether each is in the second half of its interval, NaN where it is halfway."""
    first = np.flatnonzero(place == 0)
    length = np.diff(np.append(first, len(place)))
    interval = np.cumsum(place == 0) - 1
    to_end = length[interval] - place
    begins = np.flatnonzero(to_end % size == 0)
    count, left = length[interval[begins]] // size, to_end[begins] // size
    middle = 2 * (count - left) + 1  # halves of windows before it
    return begins, np.where(middle == count, np.nan, middle > count)


def _parts(mode: NDArray, late: Floats) -> list[TwoSides]:
    modes, parts = np.unique(mode), list[TwoSides]()
    pairs = modes[1:] if len(modes) == 2 else modes if len(modes) > 2 else modes[:0]
    parts += [TwoSides(REGIME, int(m), mode == m, mode != m) for m in pairs]
    for m in modes:
        inside = mode == m
        second = inside & (np.cumsum(inside) > inside.sum() / 2)
        parts.append(TwoSides(SECOND, int(m), second, inside & ~second))
        parts.append(TwoSides(LATE, int(m), inside & (late == 1.0), inside & (late == 0.0)))
    return parts


def _measures(series: ResidualSeries, begins: NDArray[np.int64]) -> Measures:
    """Level, tails, colour, mean, sign, runs and spectrum of every window; all but the last of
    residuals that are made white by one autoregressive model of the sensor's noise."""
    rows = begins[:, None] + np.arange(WINDOW)
    together = Stretches(np.zeros(len(series.place), np.int64), series.place)
    white = NoiseModel.fit([together], [series.value]).whiten(together, series.value)[rows]
    square = np.maximum(np.mean(white**2, axis=1), 1e-30)
    following = white[:, 1:] * white[:, :-1]
    of_white = {
        "level": np.log(square),
        "tails": np.log(np.max(white**2, axis=1) / square),
        "colour": np.mean(following, axis=1) / square,
        "mean": white.mean(axis=1),
        "sign": np.sign(white).mean(axis=1),
        "runs": np.mean(following > 0.0, axis=1),
    }
    power = periodograms(series.value[rows])[:, LOWEST - 1 :]
    power /= np.maximum(power.mean(axis=1, keepdims=True), 1e-30)
    kinds = (*of_white, *("spectrum" for _ in power.T))
    bins = np.concatenate([np.zeros(len(of_white), np.int64), LOWEST + np.arange(power.shape[1])])
    return Measures(np.column_stack([*of_white.values(), power**NORMALISING]), kinds, bins)


def periodograms(values: Floats) -> Floats:
    """Of windows (W, n), without their means and under Hann's taper: power (W, n/2 − 1) at every
    frequency between 0 and half the sample rate, each excluded."""
    size = values.shape[1]
    tapered = (values - values.mean(axis=1, keepdims=True)) * np.hanning(size + 2)[1:-1]
    return np.asarray(np.abs(np.fft.rfft(tapered, axis=1)[:, 1:-1]) ** 2)


def _welch(sides: NDArray, values: NDArray, alike: Floats) -> tuple[Floats, Floats]:
    """Differences (…, P, k) of the means of ``values`` (W, k) on two ``sides`` (…, P, 2, W), 1
    inside of each and 0 elsewhere, and the logarithm of their two-sided p-values; differences of up
    to ``alike`` (k) count as none."""
    count = sides.sum(axis=-1)[..., None]
    moments = sides @ np.concatenate([values, values**2], axis=-1) / count
    mean, square = np.split(moments, 2, axis=-1)
    variance = np.maximum(square - mean**2, 1e-30) / (count - 1.0)
    difference = mean[..., 0, :] - mean[..., 1, :]
    more = np.maximum(np.abs(difference) - alike, 0.0)
    statistic = more / np.sqrt(variance.sum(axis=-2))
    freedom = variance.sum(axis=-2) ** 2 / (variance**2 / (count - 1.0)).sum(axis=-2)
    return difference, np.log(2.0 * stdtr(freedom, -statistic))
