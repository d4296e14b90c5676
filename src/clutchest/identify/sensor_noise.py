"""Noise of one sensor: what of its readings is neither a smooth trend nor the bus's step.

Readings are cut into windows.  Within a window the quantity itself is a straight line of unknown
level and slope plus an integrated random walk of unknown strength; the noise is AR(1), the same in
every window; the bus rounds to its step.  Noise and AR(1) coefficient maximise the likelihood of
what is left of each window without its straight line (restricted likelihood).  The strength of
the walk differs from window to window: its distribution over a grid, zero included, is
estimated with the rest (a nonparametric mixture).  Where enough of the log is quiet, a second
pass has windows between two quiet ones only: a window must not be chosen by its own readings, or
those whose slow noise happens to be large pass for drift, and what is left has too little of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clutchest.identify import window_likelihood
from clutchest.identify.window_likelihood import factor, toeplitz_row, whiten
from clutchest.inference.noise_model import median_std
from clutchest.signals import Floats, Signal

WINDOW = 128  # samples
MOST = 300  # windows that are fitted; more are thinned out evenly
MISSING = 16  # samples of a window that may be missing or far off
OUTLIER = 6.0  # robust standard deviations between a sample and its neighbours' median
QUIET = 0.5  # of the noise: a walk up to here leaves a window quiet
MOVING = 15.0  # −2 log likelihood ratio of a quiet window to a moving one; noise alone stays below
CLUSTERED = 20  # windows from which on their scatter is trusted to widen the interval
BELOW_STEP = 0.3  # of the bus step: smaller noise is hidden by rounding
WANDER = np.sqrt(WINDOW**3 / 420)  # of a window less its line, over the steps of its slope
APART = 5.0  # standard deviations from what all other samples of the window predict
LEAST = 0.05  # of the bus step: smaller noise is as good as none
_STARTS = (-0.3, 0.0, 0.3, 0.6, 0.8, 0.9, 0.95)
_WALKS = np.concatenate([[0.0], 0.3 * 2.5 ** np.arange(12)])  # strength over the first guess


@dataclass(frozen=True, slots=True)
class SensorNoise:
    """The noise of a sensor, estimated from its readings.

    ``noise``: standard deviation of the AR(1) part, in the signal's unit; ``ar``: its coefficient
    per sample; ``covariance`` (2, 2) of (log noise, artanh ar); ``step`` of the bus, 0 where the
    readings lie on no lattice; ``residuals`` (W, WINDOW): ``windows`` samples less straight line
    and walk, NaN where missing; ``quiet``: enough of them are quiet to separate slow noise from
    what the quantity itself does.
    """

    noise: float
    ar: float
    covariance: Floats
    step: float
    windows: Floats
    residuals: Floats
    quiet: bool

    @property
    def rounding(self) -> float:
        """Standard deviation of what rounding to the step adds, step/√12."""
        return self.step / np.sqrt(12)

    @property
    def total(self) -> float:
        """Standard deviation of noise and rounding together."""
        return float(np.hypot(self.noise, self.rounding))


def bus_step(values: Sequence[Floats]) -> float:
    """The step of the lattice on which all readings lie; 0 where there is none."""
    distinct = np.unique(np.concatenate([*values, np.empty(0)]))
    scale = max(1.0, float(np.abs(distinct).max(initial=0.0)))
    gaps = np.diff(distinct)
    gaps = gaps[gaps > 1e-9 * scale]
    if not len(gaps):
        return 0.0
    step = float(gaps.min())
    multiples = gaps / step
    return step if np.all(np.abs(multiples - np.rint(multiples)) < 1e-2) else 0.0


@dataclass(frozen=True, slots=True)
class Windows:
    """Readings cut up: ``values`` (W, WINDOW), NaN where one is missing, invalid or far off;
    ``place`` (W,) ascending, neighbours in time are one apart."""

    values: Floats
    place: NDArray[np.intp]

    def __len__(self) -> int:
        return len(self.values)

    def between(self, flag: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Windows (W,) of which the neighbours on both sides have the ``flag`` (W,)."""
        flagged = self.place[flag]
        return np.isin(self.place - 1, flagged) & np.isin(self.place + 1, flagged)


def windows_of(signals: Sequence[Signal]) -> Windows:
    """The windows of all drives.

    Those with more than MISSING samples missing are left out, and so are those that touch a zero
    which is the bus's lower end: there half of the noise is cut off.
    """
    rows = [_regular(signal) for signal in signals]
    least = min((float(np.nanmin(row)) for row in rows if np.isfinite(row).any()), default=1.0)
    parts, places, first = [np.empty((0, WINDOW))], [np.empty(0, np.intp)], 0
    for row in rows:
        ends = row == least if least == 0.0 else np.zeros(len(row), bool)
        row = np.where(far_off(row), np.nan, row)
        count = len(row) // WINDOW
        window = row[: count * WINDOW].reshape(count, WINDOW)
        cut = ends[: count * WINDOW].reshape(count, WINDOW).any(axis=1)
        keep = ~cut & (np.isnan(window).sum(axis=1) <= MISSING)
        parts.append(window[keep])
        places.append(first + np.flatnonzero(keep))
        first += count + 2  # the next drive has no neighbours in this one
    return Windows(np.concatenate(parts), np.concatenate(places))


def _thinned(values: Floats) -> Floats:
    """At most MOST of the ``values`` (W, …), evenly."""
    if len(values) <= MOST:
        return values
    return values[np.linspace(0, len(values) - 1, MOST).astype(int)]


def _regular(signal: Signal) -> Floats:
    """The readings by sample number, NaN where one is missing; a long gap spans one window."""
    if len(signal) < 2:
        return signal.value.copy()
    steps = np.diff(signal.time)
    period = np.median(steps)
    steps = np.clip(np.rint(steps / max(period, 1e-9)), 1, WINDOW).astype(np.intp)
    place = np.concatenate([[0], np.cumsum(steps)])
    row = np.full(place[-1] + 1, np.nan)
    row[place] = signal.value
    return row


def far_off(row: Floats) -> NDArray[np.bool_]:
    """Samples that stand apart from their neighbours on both sides.

    Not ``estimate.spikes``: that one goes by the stated noise, which is what is sought here, and
    leaves a peak of two samples in, since it must never cut off what the clutch did.  Here a
    healthy sample too many costs nothing, an outlier that stays is taken for noise.
    """
    if len(row) < 5:
        return np.zeros(len(row), bool)
    padded = np.pad(row, 2, mode="edge")
    around = np.lib.stride_tricks.sliding_window_view(padded, 5)[:, [0, 1, 3, 4]]
    with np.errstate(invalid="ignore"):
        apart = np.abs(row - np.median(around, axis=1))
        spread = median_std(apart[np.isfinite(apart)]) if np.isfinite(apart).any() else 0.0
        spread = max(spread, bus_step([row[np.isfinite(row)]]))
        # on a steep trend the neighbours lie apart from each other as well
        return apart > OUTLIER * spread + np.ptp(around, axis=1)


def estimate(windows: Windows, step: float) -> SensorNoise | None:
    """Fit noise and AR(1) coefficient to ``windows``.

    ``noise`` 0 where every window is one straight line; None where there is no window.
    """
    if not len(windows):
        return None
    likelihood = _Likelihood(_thinned(windows.values), step)
    if likelihood.rough == 0.0:
        values = likelihood.windows
        level = values - np.nanmean(values, axis=1, keepdims=True)
        return SensorNoise(0.0, 0.0, np.zeros((2, 2)), step, values, level, False)
    theta = _maximise(likelihood)
    whole = likelihood.over(windows.values)
    values = np.where(whole.apart(theta), np.nan, windows.values)
    usable = np.isnan(values).sum(axis=1) <= MISSING
    quiet = usable & whole.quiet(theta)
    quiet_ones = usable & windows.between(quiet) & ~whole.moving(theta)
    # where little else moves, little else can be mistaken for noise
    if quiet_ones.sum() >= CLUSTERED:
        walk_strengths = likelihood.walk_strengths[
            likelihood.walk_strengths <= _quietest(theta, 2 * QUIET)
        ]
        likelihood = _Likelihood(
            _thinned(values[quiet_ones]), step, walk_strengths, likelihood.rough
        )
    elif usable.any():
        rows = _thinned(values[usable])
        likelihood = _Likelihood(rows, step, likelihood.walk_strengths, likelihood.rough)
    theta = _maximise(likelihood)
    return SensorNoise(
        noise=float(np.exp(theta[0])),
        ar=float(np.tanh(theta[1])),
        covariance=likelihood.covariance(theta),
        step=step,
        windows=likelihood.windows,
        residuals=likelihood.residuals(theta),
        quiet=bool(quiet.sum() >= min(CLUSTERED, usable.sum() / 2)),
    )


def _quietest(theta: Floats, share: float) -> float:
    """Strength of the walk that moves a window by a ``share`` of the noise."""
    return float(share * np.exp(theta[0]) / WANDER)


def _maximise(likelihood: _Likelihood) -> Floats:
    """(log noise, artanh AR coefficient) of the greatest likelihood."""
    from scipy.optimize import minimize

    first = [np.array([np.log(likelihood.noise_for(ar)), np.arctanh(ar)]) for ar in _STARTS]
    start = min(first, key=likelihood.total)
    simplex = start + np.array([[0, 0], [0.1, 0.02], [-0.02, 0.1]])
    options = {"xatol": 2e-3, "fatol": 0.02, "initial_simplex": simplex}
    best: Floats = minimize(likelihood.total, start, method="Nelder-Mead", options=options).x
    return best


def _scatter(values: Floats) -> float:
    """A robust standard deviation, of all that are finite."""
    finite = values[np.isfinite(values)]
    if not len(finite):
        return 0.0
    robust = median_std(finite)
    return robust or float(np.sqrt(np.mean(finite**2)))  # rounding makes most of them zero


class _Likelihood:
    """Restricted likelihood of windows, for (log noise, artanh AR coefficient)."""

    def __init__(
        self,
        windows: Floats,
        step: float,
        walk_strengths: Floats | None = None,
        rough: float = 0.0,
    ) -> None:
        self.windows, self.step = windows, step
        self.missing = np.isnan(windows)
        filled = np.where(self.missing, 0.0, windows - np.nanmean(windows, axis=1, keepdims=True))
        self.filled = filled
        self.second = np.ascontiguousarray(np.diff(filled, 2, axis=1).T)
        self.rough = rough or _scatter(np.diff(windows, 2, axis=1))
        self.guess = self.noise_for(0.0)
        self.walk_strengths = (
            self.guess / WANDER * _WALKS if walk_strengths is None else walk_strengths
        )
        self.weights = np.full(len(self.walk_strengths), 1 / len(self.walk_strengths))

    def over(self, windows: Floats) -> _Likelihood:
        """The same distribution of walk strengths over other ``windows`` (W, WINDOW)."""
        other = _Likelihood(windows, self.step, self.walk_strengths, self.rough)
        other.weights = self.weights
        return other

    def noise_for(self, ar: float) -> float:
        """The noise whose second differences scatter as those of the windows do."""
        return max(self.rough / np.sqrt(6 - 8 * ar + 2 * ar**2), 2 * LEAST * self.step)

    def total(self, theta: Floats) -> float:
        """−2 log likelihood."""
        return float(self.each(theta).sum())

    def each(self, theta: Floats, refit: bool = True) -> Floats:
        """−2 log likelihood of every window; ``refit`` the distribution of walk strengths first."""
        if abs(theta[1]) > 3.0 or abs(theta[0] - np.log(self.guess)) > 8.0:
            return np.full(len(self.windows), 1e9)  # AR beyond ±0.995: no noise any more
        if np.exp(theta[0]) < LEAST * self.step:
            return np.full(len(self.windows), 1e9)
        table = self.table(theta)
        top = table.min(axis=1, keepdims=True)
        ratio = np.exp(-(table - top) / 2)
        if refit:
            self.weights = np.full(len(self.walk_strengths), 1 / len(self.walk_strengths))
            for _ in range(60):  # expectation maximisation, each time afresh
                shares = ratio * self.weights
                self.weights = np.mean(shares / shares.sum(axis=1, keepdims=True), axis=0)
        return top[:, 0] - 2 * np.log(ratio @ self.weights)

    def table(self, theta: Floats) -> Floats:
        """−2 log likelihood (W, strengths) of every window under every strength of the walk."""
        row = toeplitz_row(self.autocovariance(theta))
        table: Floats = window_likelihood.table(row, self.walk_strengths, self.second, self.missing)
        return table

    def autocovariance(self, theta: Floats) -> Floats:
        """Of noise and rounding at lags 0 … WINDOW−1."""
        noise, ar = np.exp(theta[0]), np.tanh(theta[1])
        lag = np.arange(WINDOW)
        row = noise**2 * ar**lag
        if self.step:
            # Rounding errors of neighbours agree while both fall into one step: an average over
            # all places of the trend between steps (Fourier series of the sawtooth).
            moved = 2 * noise**2 * (1 - ar**lag)
            k = np.arange(1, 6)[:, None]
            agree = np.exp(-2 * np.pi**2 * k**2 * moved / self.step**2) / k**2
            row += self.step**2 / (2 * np.pi**2) * agree.sum(axis=0)
        return row

    def covariance(self, theta: Floats) -> Floats:
        """Covariance (2, 2) of the estimate: from the curvature, or the scatter of the windows'
        scores where that is wider (the model is never quite true)."""
        h = 0.02
        unit = h * np.eye(2)
        # the distribution of walk strengths moves along: its own doubt is in the curvature as well
        at = {
            (i, j): self.total(theta + i * unit[0] + j * unit[1])
            for i in (-1, 0, 1)
            for j in (-1, 0, 1)
        }
        hessian = np.empty((2, 2))
        hessian[0, 0] = at[1, 0] - 2 * at[0, 0] + at[-1, 0]
        hessian[1, 1] = at[0, 1] - 2 * at[0, 0] + at[0, -1]
        hessian[0, 1] = hessian[1, 0] = (at[1, 1] - at[1, -1] - at[-1, 1] + at[-1, -1]) / 4
        hessian /= 2 * h**2
        self.total(theta)
        scores = np.stack([self.each(theta + s, False) - self.each(theta - s, False) for s in unit])
        scores /= 4 * h
        values, vectors = np.linalg.eigh(hessian)
        inverse = (vectors / np.maximum(values, 1e-2)) @ vectors.T
        if scores.shape[1] < CLUSTERED:
            return inverse
        robust = inverse @ (scores @ scores.T) @ inverse
        wider = np.sqrt(np.maximum(np.diag(robust) / np.diag(inverse), 1.0))
        return inverse * np.outer(wider, wider)

    def shares(self, theta: Floats) -> Floats:
        """Probability (W, strengths) of every walk in every window."""
        with np.errstate(divide="ignore"):  # a strength that no window has
            likely = np.log(self.weights) - self.table(theta) / 2
        shares = np.exp(likely - likely.max(axis=1, keepdims=True))
        return shares / shares.sum(axis=1, keepdims=True)

    def quiet(self, theta: Floats) -> NDArray[np.bool_]:
        """Windows (W,) in which the quantity itself moves less than the noise."""
        quiet_ones = self.walk_strengths <= _quietest(theta, QUIET)
        return self.shares(theta)[:, quiet_ones].sum(axis=1) > 0.5

    def moving(self, theta: Floats) -> NDArray[np.bool_]:
        """Windows (W,) in which the quantity moves, beyond what noise could feign."""
        table = self.table(theta)
        quiet_ones = self.walk_strengths <= _quietest(theta, QUIET)
        return table[:, quiet_ones].min(axis=1) - table.min(axis=1) > MOVING

    def apart(self, theta: Floats) -> NDArray[np.bool_]:
        """Samples (W, WINDOW) far from what the others of their window foretell."""
        likeliest = np.argmax(self.shares(theta), axis=1)
        row = toeplitz_row(self.autocovariance(theta))
        far = np.zeros(self.windows.shape, bool)
        differences = np.diff(np.eye(WINDOW), 2, axis=0)
        for j in np.unique(likeliest):
            half = whiten(factor(row, self.walk_strengths[j]), differences)
            precision = half.T @ half
            for w in np.flatnonzero(likeliest == j):
                missing = self.missing[w]
                pull = half.T @ (half @ self.filled[w])
                if missing.any():  # as if they had been read where the others predict them
                    solved = np.linalg.solve(precision[np.ix_(missing, missing)], pull[missing])
                    pull = pull - precision[:, missing] @ solved
                far[w] = np.abs(pull) > APART * np.sqrt(np.diag(precision))
        return far & ~self.missing

    def residuals(self, theta: Floats) -> Floats:
        """Readings less the expected line and walk, each window under its most probable walk."""
        from scipy.linalg import toeplitz

        likeliest = np.argmax(self.shares(theta), axis=1)
        own = toeplitz(self.autocovariance(theta))
        row = toeplitz_row(own[0])
        left = np.empty(self.windows.shape)
        for j in np.unique(likeliest):
            rows = np.flatnonzero(likeliest == j)
            lower = factor(row, self.walk_strengths[j])
            white = whiten(lower, np.diff(own, 2, axis=0))
            left[rows] = whiten(lower, self.second[:, rows]).T @ white
        left[self.missing.any(axis=1)] = np.nan
        return left
