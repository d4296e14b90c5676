"""Lines in the spectrum of residuals: a peak of the periodogram over its smooth surroundings.

Welch's method: periodograms of overlapping windows under Hann's taper are averaged, each over how
loud it is, so that level and outliers do nothing.  How loud is judged at all frequencies alike:
mean power would be that of a few slow ones where noise is slow, and scatter with them.  The
logarithm at every frequency is compared with a parabola through its neighbours on both sides, those
that a line there would leak into left out.  So whatever smooth spectrum the noise has, of its
sensor and of the filter, is no line.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr

from clutchest.discovery.noise_contrasts import periodograms
from clutchest.signals import Floats

SIZES = {128: 6, 512: 12}  # residuals in a window → neighbours on each side that are compared
LEAK = 2  # bins on each side that a line under Hann's taper leaks into
SIDE = 2  # neighbours that there must be on each side
FEWEST = 4  # windows
SMOOTH = 0.02  # of the logarithm: standard deviation by which a smooth spectrum is no parabola
CORRELATED = 0.25  # share of each neighbour that gives adjacent bins Hann's correlation of 4/9
TURNS = 4  # of the loudness of windows and the spectrum, each from the other
TINY = 1e-30  # of power
INDEPENDENT = 1.0 / (1.0 + 2.0 / 36.0)  # windows that overlap by half, worth as many that do not


@dataclass(frozen=True, slots=True)
class LineTests:
    """Of residuals in windows of one size: ``frequency`` (F) in cycles per residual, the logarithm
    of the p-value of a line at each, ``log_p`` (F), the smallest of white noise in as many windows,
    ``null`` (draws), and the ``amplitude`` (F) of a line at each in the residuals' unit."""

    frequency: Floats
    log_p: Floats
    null: Floats
    amplitude: Floats


def lines(
    values: Floats, place: NDArray[np.int64], draws: int, rng: np.random.Generator
) -> list[LineTests]:
    """Lines in residuals ``values`` (n) of one regime, the ``place`` (n) of each in its interval;
    one table per size of windows that there are enough of."""
    found = []
    for size, reach in SIZES.items():
        begins = _begins(place, size)
        if len(begins) < FEWEST:
            continue
        window = values[begins[:, None] + np.arange(size)]
        spectrum = _mean_spectrum(periodograms(window))
        excess_of, bins = _excess_operator(len(spectrum), reach)
        excess = excess_of @ np.log(spectrum)
        null = _white(len(spectrum), len(begins) * INDEPENDENT, draws, rng) @ excess_of.T
        middle, spread = null.mean(axis=0), np.hypot(null.std(axis=0), SMOOTH)
        null += SMOOTH * rng.standard_normal(null.shape)
        leaked = np.convolve(spectrum, np.ones(2 * LEAK + 1), "same")[bins]
        surroundings = (2 * LEAK + 1) * spectrum[bins] * np.exp(-excess)
        share = np.maximum(leaked - surroundings, 0.0) / spectrum.sum()
        amplitude = np.sqrt(2.0 * share * window.var(axis=1).mean())
        found.append(
            LineTests(
                (bins + 1 + _offset(np.log(spectrum))[bins]) / size,
                log_ndtr((middle - excess) / spread),
                log_ndtr(-((null - middle) / spread).max(axis=1)),
                amplitude,
            )
        )
    return found


def _mean_spectrum(power: Floats) -> Floats:
    """The mean (F) of periodograms ``power`` (W, F), each over how many times as loud it is, which
    is the mean of its ratios to that spectrum: the likeliest where each is a copy of one spectrum,
    of any level, times exponential variates."""
    spectrum = np.maximum(power.mean(axis=0), TINY)
    for _ in range(TURNS):
        times = np.maximum((power / spectrum).mean(axis=1, keepdims=True), TINY)
        spectrum = np.maximum((power / times).mean(axis=0), TINY)
    return spectrum


def _begins(place: NDArray[np.int64], size: int) -> NDArray[np.int64]:
    """Where windows of ``size`` residuals begin, each half a window after the one before."""
    if len(place) < size:
        return np.zeros(0, np.int64)
    begins = np.arange(len(place) - size + 1)
    whole = place[begins + size - 1] - place[begins] == size - 1
    return begins[whole & (place[begins] % (size // 2) == 0)]


def _offset(logarithm: Floats) -> Floats:
    """From every bin (F) of a spectrum to the top of the parabola through it and its two
    neighbours, in bins; 0 where it is no peak."""
    before, after = logarithm[:-2], logarithm[2:]
    bend = before - 2.0 * logarithm[1:-1] + after
    slope = (before - after) / 2.0
    offset = np.divide(slope, bend, out=np.zeros_like(bend), where=bend < 0.0)
    return np.pad(np.where(np.abs(offset) <= 1.0, offset, 0.0), 1)


@cache
def _excess_operator(count: int, reach: int) -> tuple[Floats, NDArray[np.int64]]:
    """What takes the logarithm of a spectrum (count) to its excess (F) over a parabola through
    ``reach`` neighbours on each side, and the bins (F) that have enough of them."""
    rows, bins = [], []
    for j in range(count):
        near = np.arange(max(0, j - reach), min(count, j + reach + 1))
        near = near[np.abs(near - j) > LEAK]
        if min(np.sum(near < j), np.sum(near > j)) < SIDE:
            continue
        row = np.zeros(count)
        row[j] = 1.0
        row[near] = -np.linalg.pinv(np.vander(near - j, 3, increasing=True).astype(float))[0]
        rows.append(row)
        bins.append(j)
    return np.array(rows), np.array(bins)


def _white(count: int, windows: float, draws: int, rng: np.random.Generator) -> Floats:
    """Logarithms (draws, count) of averaged spectra of white noise: gamma variates, of which every
    bin takes a share of its neighbours'."""
    own = 1.0 + 2.0 * CORRELATED**2
    shape = windows * own / (1.0 + 2.0 * CORRELATED) ** 2
    gamma = rng.gamma(shape, 1.0, (draws, count + 2))
    mixed = gamma[:, 1:-1] + CORRELATED * (gamma[:, 2:] + gamma[:, :-2])
    return np.log(mixed / (shape * (1.0 + 2.0 * CORRELATED)))
