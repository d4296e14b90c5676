"""Signals without their own noise: deadband filter, adaptive mean, denoised rate.

Where a derivative is taken at a noisy value, and the innovation beside it holds the same noise,
the two seem to have something in common.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from clutchest.inference.parabolas import parabolas
from clutchest.native import compiled
from clutchest.signals import Floats

GRID = 0.01  # s
# s over which a rate is taken: of an input, and of what masses make of it
BRIEF, CALM = (0.06, 0.12), (0.2,)
FINE = 0.1  # of a rate, root mean square, up to which noise may reach for it to be taken over less
CALMER = 2.5  # times that: over which the noise of a rate is seen
NARROW, WIDE = 0.2, 0.5  # s over which a signal is smoothed, and over which its noise is seen
QUARTER = 3.1383  # standard deviations to the deviation within which a quarter of normal noise lies
REACH = 3.0  # standard deviations of noise that do not move it
WINDOWS = 0.05 * 2.0 ** (np.arange(11) / 2.0)  # s, to 1.6
LINE = 3  # samples, through which a line is more than a sample
AGREE = 2.5  # standard deviations of a mean, by which the truth may be off it


def deadband(
    t: Floats,
    value: Floats,
    where: NDArray[np.bool_],
    narrow: float = NARROW,
    wide: float = WIDE,
    most: float = np.inf,
) -> Floats:
    """``value`` (K) at times ``t`` (K), smoothed over ``narrow`` s as far as it is noisy, moving
    only where it leaves the reach of its noise; that is what ``wide`` s smooth away, measured
    ``where`` (K) the signal matters, and at ``most`` so much."""
    if not len(value):
        return value
    reach = REACH * min(_noise(value - _smooth(t, value, wide), where), most)
    out = np.empty_like(value)
    _play(_smooth(t, value, narrow), reach, out)
    return np.clip(out, value - 2.0 * reach, value + 2.0 * reach)


def adaptive_mean(t: Floats, value: Floats, noise: float, ar: float) -> Floats:
    """The same for what drags something along, by moves as small as the noise: at each sample the
    mean over the longest of ``WINDOWS`` s that agrees with all shorter ones, given the signal's
    ``noise`` and its AR(1) coefficient (Katkovnik 1999, intersection of confidence intervals)."""
    period = _period(t)
    if not (period > 0.0 and 0.0 < noise < np.inf):
        return value
    grid = np.arange(t[0], t[-1] + period / 2.0, period)
    read = np.interp(grid, t, value)
    value_at, agree = read.copy(), np.ones(len(read), bool)
    lower, upper = np.full(len(read), -np.inf), np.full(len(read), np.inf)
    for window in WINDOWS:
        count = round(window / period) | 1
        if count > len(read):
            break
        mean = _lines(read, count) if count >= LINE else read
        reach = AGREE * noise * _scatter(count, ar)
        lower, upper = np.maximum(lower, mean - reach), np.minimum(upper, mean + reach)
        agree &= lower <= upper
        value_at = np.where(agree, mean, value_at)
    return np.asarray(np.interp(t, grid, value_at))


def _lines(read: Floats, count: int) -> Floats:
    """Straight lines through so many samples around each of ``read`` (K), or the nearest so many at
    the ends: in the middle a running mean, which takes no longer for a longer window."""
    mean, half = uniform_filter1d(read, count), count // 2
    offset = np.arange(-half, half + 1.0)
    for part, at in ((slice(0, count), slice(0, half)), (slice(-count, None), slice(-half, None))):
        slope = offset @ read[part] / (offset @ offset)
        mean[at] = read[part].mean() + slope * offset[at]
    return np.asarray(mean)


def mean_of_slow(t: Floats, value: Floats, noise: float, ar: float) -> Floats:
    """The adaptive mean of a signal that comes more seldom than every ``GRID`` s: over as many
    samples as of one that comes so often, however long they take."""
    return adaptive_mean(t * (GRID / max(_period(t), GRID)), value, noise, ar)


def deadband_of_mean(
    t: Floats, value: Floats, mean: Floats, where: NDArray[np.bool_], most: float, ar: float
) -> Floats:
    """The adaptive ``mean`` of ``value`` without the moves that noise still gives it: a play of
    nothing, which is how a play begins, is turned by any move, however small.  The noise is what
    the mean leaves ``where`` (K) the signal matters, at ``most`` so much."""
    period = _period(t)
    if not (period > 0.0 and where.any()):
        return mean
    noise = min(_noise(value - mean, where), most) * _scatter(round(NARROW / period) | 1, ar)
    out = np.empty_like(mean)
    _play(mean, REACH * noise, out)
    return out


def denoised_rate(
    t: Floats, value: Floats, where: NDArray[np.bool_], windows: tuple[float, ...] = BRIEF
) -> Floats:
    """The rate of ``value`` (K) at times ``t`` (K), per s, by parabolas through the first of the
    ``windows``, s, over which noise reaches little of it ``where`` (K) it matters, or the last;
    zero within the reach of its noise, which the innovations hold as well."""
    rate, reach = np.zeros(len(value)), 0.0
    for window in windows if len(value) else ():
        rate = _smooth(t, value, window, 1)
        off = rate - _smooth(t, value, max(NARROW, CALMER * window), 1)
        reach = REACH * _noise(off, where)
        if reach <= FINE * np.sqrt(np.mean(_of_use(rate, where) ** 2)):
            break
    return _beyond(rate, reach)


def denoised_slope(t: Floats, slope: Floats, where: NDArray[np.bool_]) -> Floats:
    """The same of a ``slope`` (K) that is known, with noise."""
    return _beyond(slope, REACH * _noise(slope - _smooth(t, slope, WIDE), where))


def _beyond(rate: Floats, reach: float) -> Floats:
    """A ``rate`` (K) beyond the ``reach`` of its noise."""
    return np.asarray(np.sign(rate) * np.maximum(np.abs(rate) - reach, 0.0))


def _of_use(value: Floats, where: NDArray[np.bool_]) -> Floats:
    """``value`` (K) ``where`` (K) it matters, anywhere if it does nowhere."""
    return value[where] if where.any() else value


def _period(t: Floats) -> float:
    """s from sample to sample; 0 where there are none."""
    return float(np.median(np.diff(t))) if len(t) > 1 else 0.0


def _noise(off: Floats, where: NDArray[np.bool_]) -> float:
    """The standard deviation of what of ``off`` (K) is noise: what bends is off by more.  Seen
    ``where`` (K) it matters."""
    return QUARTER * float(np.quantile(np.abs(_of_use(off, where)), 0.25))


def _scatter(count: int, ar: float) -> float:
    """Standard deviation of the mean of so many samples of AR(1) noise, of one sample's."""
    lags = np.arange(1, count)
    return float(np.sqrt((1.0 + 2.0 * ((1.0 - lags / count) * ar**lags).sum()) / count))


def _smooth(t: Floats, value: Floats, window: float, rate: int = 0) -> Floats:
    """``value`` (K) at times ``t`` (K), or with 1 its ``rate``, by parabolas through ``window``
    s."""
    grid, count = np.arange(t[0], t[-1], GRID), round(window / GRID) | 1
    if len(grid) < count:
        return np.zeros_like(value) if rate else value  # too short to tell a rate
    return np.asarray(np.interp(t, grid, parabolas(np.interp(grid, t, value), count, rate, GRID)))


@compiled
def _play(value: Floats, reach: float, out: Floats) -> None:
    """What a value drags along that has a play of ±``reach``."""
    held = value[0]
    for k in range(len(value)):
        held = min(max(held, value[k] - reach), value[k] + reach)
        out[k] = held
