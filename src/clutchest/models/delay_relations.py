"""Relations between signals by which a machine shows how late one of them is.

A relation gives stretches of a drive over which a late signal y obeys
y(t) = x_0(t − τ) + Σ c_i x_i(t − τ), with coefficients c_i that each stretch has for itself.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clutchest.models.regimes import runs
from clutchest.signals import Floats, Signal

STEP = 0.01  # s, of the common grid
SMOOTH = 0.025  # s, standard deviation of the common smoothing …
SMOOTH_SAMPLES = 1.5  # … or so many samples of the slower signal
EDGE = 0.1  # s left out at both ends of a stretch, beside what smoothing mixes in: signals that
# are late change their mode late
LONGEST = 20.0  # s of one stretch
Mask = NDArray[np.bool_]
Columns = Callable[[float], tuple[Floats, Floats]]


@dataclass(frozen=True, slots=True)
class DelayStretch:
    """``columns(delay)`` gives y − x_0 (n,) and the columns x_i (n, q) of the relation."""

    columns: Columns


@dataclass(frozen=True, slots=True)
class GriddedSignals:
    """One drive on a grid of STEP s: its ``signals``, where they have samples, its ``mode`` (n) at
    ``time`` (n) s, and the vehicle's ``parameters`` by key."""

    parameters: Mapping[str, float]
    signals: Mapping[str, Signal]
    time: Floats
    mode: NDArray[np.uint8]

    def has(self, *names: str) -> bool:
        """Whether all these signals are there."""
        return all(name in self.signals for name in names)

    def raw(self, name: str) -> Floats:
        """A signal straight between its samples, on the grid."""
        return np.interp(self.time, self.signals[name].time, self.signals[name].value)

    def smooth(self, name: str, width: float) -> Floats:
        """The same, smoothed over ``width`` s."""
        return smoothed(self.raw(name), width)

    def width(self, *names: str) -> float:
        """Smoothing in s that suits all these signals."""
        periods = [float(np.median(np.diff(self.signals[name].time))) for name in names]
        return max(SMOOTH, SMOOTH_SAMPLES * max(periods))

    def whole(self, *names: str) -> Mask:
        """Where none of these signals has a gap."""
        good = np.ones(len(self.time), bool)
        for name in names:
            stamps = self.signals[name].time
            steps = np.diff(stamps)
            after = np.clip(np.searchsorted(stamps, self.time), 1, len(stamps) - 1)
            good &= steps[after - 1] <= max(0.1, 3 * float(np.median(steps)))
            good &= (self.time >= stamps[0]) & (self.time <= stamps[-1])
        return good

    def away_from(self, flag: Mask, seconds: float) -> Mask:
        """Where ``flag`` is False at least so many ``seconds`` before and after."""
        near = int(seconds / STEP)
        counts = np.cumsum(np.concatenate([np.zeros(near + 1), flag, np.zeros(near)]))
        around: Mask = counts[2 * near + 1 :] - counts[: -2 * near - 1] == 0
        return around

    def rows(self, flag: Mask, least: float, width: float) -> list[NDArray[np.intp]]:
        """Grid rows of every stretch of ``flag`` of ``least`` s: closer than the smoothing, so that
        noise weighs alike whatever the delay."""
        edge, most = int((EDGE + 3 * width) / STEP), int(LONGEST / STEP)
        rows = []
        for start, end in zip(*runs(flag), strict=True):
            for begin in range(start + edge, end - edge, most):
                stop = min(begin + most, end - edge)
                if (stop - begin) * STEP >= least:
                    rows.append(np.arange(begin, stop, max(int(width / STEP / 2), 1)))
        return rows

    def stretch(
        self,
        rows: NDArray[np.intp],
        y: Floats,
        known: Floats | None,
        own: list[Floats],
        level: bool = True,
    ) -> DelayStretch:
        """y less ``known`` at the rows, to be explained by ``own`` columns, both ``delay`` s
        earlier; ``level`` gives the stretch a constant.

        Between the grid's rows all is a cubic spline: straight lines average the noise there, and
        least noise would pass for the delay.
        """
        from scipy.interpolate import CubicSpline

        part = slice(max(int(rows[0] - 1 / STEP), 0), int(rows[-1] + 1 / STEP))
        time, at = self.time[part], self.time[rows]
        read, splines = y[rows], [CubicSpline(time, column[part]) for column in own]
        cause = None if known is None else CubicSpline(time, known[part])

        def columns(delay: float) -> tuple[Floats, Floats]:
            left = read if cause is None else read - cause(at - delay)
            constant = [np.ones(len(at))] if level else []
            return left, np.column_stack([*constant, *(spline(at - delay) for spline in splines)])

        return DelayStretch(columns)


Stretches = Callable[[GriddedSignals, Mapping[str, float]], list[DelayStretch]]


@dataclass(frozen=True, slots=True)
class DelayRelation:
    """How the delay of ``signal`` shows.

    ``needs``: what it needs to be seen in, in words.  ``stretches(drive, delays)`` of one drive,
    given the ``delays`` (s) of the signals that it comes ``after``, each of which must be
    determined first; spreads of these ``parameters`` add to its standard deviation.  ``reversed``:
    the columns come later, not earlier, so that the delay has the opposite sign; ``shift`` s moves
    the range that is searched.  ``behind``: a signal from whose delay it is counted.
    """

    signal: str
    needs: str
    stretches: Stretches
    after: tuple[str, ...] = ()
    parameters: tuple[str, ...] = ()
    reversed: bool = False
    shift: float = 0.0
    behind: str = ""


def smoothed(value: Floats, width: float) -> Floats:
    """Values (n,) on the grid, smoothed over ``width`` s."""
    from scipy.ndimage import gaussian_filter1d

    result: Floats = gaussian_filter1d(value, width / STEP, mode="nearest")
    return result


def rate(value: Floats) -> Floats:
    """Slope (n,) of values on the grid, per s."""
    slope: Floats = np.gradient(value, STEP)
    return slope
