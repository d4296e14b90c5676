"""Judder: lines in the residual of the output's sensor while surfaces slide.

The sensor's innovations, in units of their standard deviation, are cut into windows and averaged
over them (Welch) at fixed frequencies, and at fixed orders of the slip.  In a healthy machine each
average is of exponential numbers about its surroundings in the spectrum; a line stands out of them
(a test of a gamma distribution).  Of the best frequency and the best order, that is reported which
explains more of the innovations.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import lgamma, log, pi

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from clutchest.estimate.judder_line import JudderLine
from clutchest.estimate.run import Track
from clutchest.models.declarations import Judder
from clutchest.signals import Floats, Signals

WINDOW = 0.5  # s
LOWEST = 4.0  # Hz: slower, the response to an actuation is no line
HIGHEST = 0.45  # of the sampling rate
AROUND = 8  # lines on either side that are the surroundings
FEWEST = 3  # windows
INDEPENDENT = 0.9  # of the windows, which overlap by half
FINE = 0.02  # Hz, to which a frequency is refined
VARIES = 0.1  # of its mean: a slip that varies less does not part an order from a frequency
RANGE = 10.0  # of the slip, from its median up, for which orders are tried
SHORTEST_H = 0.25  # h; a shorter drive counts as this long


@dataclass(frozen=True, slots=True)
class _Windows:
    """``time`` s and residual ``z`` (w, n) of w windows with their ``std`` in the sensor's unit,
    revolutions that slipped ``turned`` (w, n) and the rate ``slip`` (w) in rad/s."""

    time: Floats
    turned: Floats
    z: Floats
    std: float
    slip: Floats


def judder(
    declared: Judder | None,
    signals: Signals,
    track: Track,
    parameters: Mapping[str, float],
    per_1000h: float,
) -> JudderLine | None:
    """The strongest line of one drive, None where nothing stands out at this rate of false alarms,
    where the machine declares no ``judder`` or none of its sensors was read."""
    if declared is None:
        return None
    sensor = next((name for name in declared.sensors if name in signals.available), None)
    weights = next((w for w in declared.slip if set(w) <= signals.available), None)
    if sensor not in track.innovations.names or weights is None:
        return None
    windows = _windows(signals, track, sensor, weights)
    if windows is None:
        return None
    hours = max(float(track.time[-1] - track.time[0]) / 3600.0, SHORTEST_H)
    level = log(per_1000h * hours / 1000.0)
    by_time, by_slip = _by_time_and_slip(windows, level)
    if by_time is None:
        return None
    best = by_slip if by_slip and by_slip.explains > by_time.explains else by_time
    is_order = best is by_slip
    log_p = min(line.log_p for line in (by_time, by_slip) if line)
    if log_p > level:
        return None
    amplitude = windows.std * best.amplitude
    if amplitude < declared.least:
        return None
    mean_slip = float(np.mean(windows.slip))
    varies = float(np.std(windows.slip)) > VARIES * mean_slip
    kind = ("order" if is_order else "frequency") if varies else "either"
    frequency = best.line * mean_slip / (2.0 * pi) if is_order else best.line
    output = _mean_output(signals, sensor, windows)
    order = frequency * 2.0 * pi / mean_slip if kind != "frequency" else None
    slope = None
    if kind != "order":
        slope = declared.slope(parameters, signals.available, frequency, output)
    return JudderLine(
        kind=kind,
        frequency_hz=frequency,
        order=order,
        amplitude=amplitude,
        output=output,
        slip=mean_slip,
        duration_s=WINDOW * (len(windows.z) + 1) / 2.0,
        p_value=min(float(np.exp(log_p)), 1.0),
        friction_slope=slope,
    )


def _windows(
    signals: Signals, track: Track, sensor: str, weights: Mapping[str, float]
) -> _Windows | None:
    """Windows of equal length of a sensor's innovations without a gap in them, each half over the
    one before."""
    time, innovation, std = track.innovations.of(sensor)
    if len(time) < 2:
        return None
    step = float(np.median(np.diff(time)))
    count = round(WINDOW / step)
    if count < 4 * LOWEST * WINDOW:
        return None
    slip = sum(weight * signals[name].only_valid().at(time) for name, weight in weights.items())
    slip = np.abs(np.asarray(slip, np.float64))
    turned = np.concatenate([[0.0], np.cumsum(np.diff(time) * (slip[1:] + slip[:-1]) / 2)])
    begins = np.arange(0, len(time) - count, count // 2)
    begins = begins[time[begins + count - 1] - time[begins] < WINDOW + 2 * step]
    begins = begins[turned[begins + count - 1] > turned[begins]]
    if len(begins) < FEWEST:
        return None
    rows = begins[:, None] + np.arange(count)
    z = innovation[rows] / std[rows]
    x = np.linspace(-1.0, 1.0, count)
    z = z - np.outer(z @ x / (x @ x), x) - z.mean(axis=1, keepdims=True)
    mean_slip = (turned[rows[:, -1]] - turned[rows[:, 0]]) / (time[rows[:, -1]] - time[rows[:, 0]])
    return _Windows(time[rows], turned[rows] / (2.0 * pi), z, float(np.median(std)), mean_slip)


@dataclass(frozen=True, slots=True)
class _Spectrum:
    """Residual ``z`` (w, n) at ``lines`` (k) per unit of ``phase`` (w, n), of which windows show
    those ``seen`` (w, k): their ``level`` (w, 1), the averages ``around`` (k) each line, and its
    own relative to them, ``x`` (k), of a gamma distribution of ``shape`` (k)."""

    z: Floats
    phase: Floats
    lines: Floats
    seen: NDArray[np.bool_]
    level: Floats
    around: Floats
    x: Floats
    shape: Floats

    @property
    def log_p(self) -> Floats:
        """ln of how seldom a line like each stands out somewhere by chance (k)."""
        return _log_sf(self.x, self.shape) + log(len(self.lines))

    def may_be(self, level: float) -> bool:
        """Whether some line may be as seldom as ``level`` (ln p): quick to say, by the leading term
        of ln p, which is below it."""
        leading = _leading_term(self.x, self.shape, np.array([*map(lgamma, self.shape)]))
        bound = np.where(self.x > self.shape, leading, -1.0)  # above the mean there are 1/e or more
        return bool(np.min(bound) + log(len(self.lines)) <= level)


@dataclass(frozen=True, slots=True)
class _Line:
    """A ``line`` with its ``amplitude`` in standard deviations and ln p, and the power that it
    ``explains``, summed over windows."""

    line: float
    amplitude: float
    log_p: float
    explains: float


def _by_time_and_slip(windows: _Windows, level: float) -> tuple[_Line | None, _Line | None]:
    """The strongest lines at fixed frequencies, and at fixed orders of the slip; None for too few
    of them, or where none is as seldom as the ``level`` (ln p)."""
    highest = HIGHEST / float(np.median(np.diff(windows.time[0])))
    rate = windows.slip / (2.0 * pi)  # revolutions per second
    lines = np.arange(LOWEST, highest, 1.0 / WINDOW)
    fastest = float(rate.max())
    most = highest / max(float(np.median(rate)), fastest / RANGE)
    orders = np.arange(LOWEST / fastest, most, 1.0 / WINDOW / fastest)
    turning = np.outer(rate, orders)
    seen = (turning > LOWEST) & (turning < highest)
    spectra = (
        _spectrum(windows.z, windows.time, lines, np.ones((len(rate), len(lines)), bool)),
        _spectrum(windows.z, windows.turned, orders, seen),
    )
    if not any(each and each.may_be(level) for each in spectra):
        return None, None
    by_time, by_slip = (_strongest(each) if each else None for each in spectra)
    return by_time, by_slip


def _spectrum(z: Floats, phase: Floats, lines: Floats, seen: NDArray[np.bool_]) -> _Spectrum | None:
    """The lines (k) that enough windows show; None where there are too few."""
    shown = np.count_nonzero(seen, axis=0)
    kept = np.flatnonzero(shown >= FEWEST)
    lines, seen, shown = lines[kept], seen[:, kept], shown[kept]
    if len(lines) < 2 * AROUND:
        return None
    power = np.abs(_transform(z, phase, lines)) ** 2
    among = np.where(seen, power, np.nan)
    some = seen.any(axis=1)
    level = np.ones((len(z), 1))
    level[some, 0] = np.maximum(np.nanmedian(among[some], axis=1) / log(2.0), 1.0)
    mean = np.sum(np.where(seen, power / level, 0.0), axis=0) / shown
    beside = sliding_window_view(np.pad(mean, AROUND, "reflect"), 2 * AROUND + 1)
    around = np.maximum(np.median(beside, axis=1), 1.0)
    shape = np.asarray(INDEPENDENT * shown, np.float64)
    return _Spectrum(z, phase, lines, seen, level, around, shape * mean / around, shape)


def _strongest(among: _Spectrum) -> _Line:
    """The line that stands out most."""
    z, phase, lines, log_p = among.z, among.phase, among.lines, among.log_p
    k = int(np.argmin(log_p))
    own = among.seen[:, k]
    width = lines[1] - lines[0]
    fine = lines[k] + np.arange(-width, width, FINE * width)
    fine_power = np.mean(np.abs(_transform(z[own], phase[own], fine)) ** 2, axis=0)
    m = int(np.argmax(fine_power))
    surroundings = float(np.mean(among.level[own]) * among.around[k])
    signal = max(float(fine_power[m]) - surroundings, 0.0)
    amplitude = float(np.sqrt(signal) * _per_root_power(z))
    shown = float(np.count_nonzero(own))
    return _Line(float(fine[m]), amplitude, float(log_p[k]), signal * shown)


def _log_sf(x: Floats, shape: Floats) -> Floats:
    """ln of the share of gamma distributions of a ``shape`` beyond ``x``, also where that is no
    floating-point number any more: its leading term."""
    from scipy.special import gammaincc, gammaln  # loads for a tenth of a second

    with np.errstate(divide="ignore"):
        exact = np.log(gammaincc(shape, x))
    return np.where(np.isfinite(exact), exact, _leading_term(x, shape, gammaln(shape)))


def _leading_term(x: Floats, shape: Floats, log_gamma: Floats) -> Floats:
    """Of ln of that share: below it for a shape of 1 or more."""
    return (shape - 1.0) * np.log(np.maximum(x, 1.0)) - x - log_gamma


def _taper(count: int) -> Floats:
    """Hann's window, its squares' mean 1."""
    taper = np.hanning(count)
    return np.asarray(taper / np.sqrt(np.mean(taper**2)))


def _per_root_power(z: Floats) -> float:
    """The amplitude of a sine whose power is 1."""
    return 2.0 / (np.sqrt(z.shape[1]) * float(np.mean(_taper(z.shape[1]))))


def _transform(z: Floats, phase: Floats, lines: Floats) -> np.ndarray:
    """(w, k), of mean square 1 where z is white and of variance 1."""
    tapered = z * _taper(z.shape[1]) / np.sqrt(z.shape[1])
    result = np.empty((len(z), len(lines)), complex)
    for w in range(len(z)):
        turns = np.outer(phase[w] - phase[w, 0], lines)
        result[w] = tapered[w] @ np.exp(-2j * pi * turns)
    return result


def _mean_output(signals: Signals, sensor: str, windows: _Windows) -> float:
    """Mean magnitude of what the sensor reads in the windows."""
    read = signals[sensor].only_valid()
    return float(np.mean(np.abs(read.at(windows.time.reshape(-1)))))
