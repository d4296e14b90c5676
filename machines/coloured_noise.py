"""Stationary noise of a spectrum, and the spectrum that the errors of a fitted machine show."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from clutchest.identify.fitted_machine import FittedMachine
from clutchest.signals import Signals

LAGS = 24  # readings, over which innovations are compared
LEAST = 0.02  # of the variance of innovations: smaller spectra are not told from it


def drawn(
    frequencies: np.ndarray,
    spectrum: np.ndarray,
    step: float,
    shape: Sequence[int],
    rng: np.random.Generator,
) -> np.ndarray:
    """Noise of this ``shape`` (…, K), samples ``step`` s apart in the last axis: of a ``spectrum``
    unit²/Hz at ``frequencies`` in Hz, none above them."""
    *others, count = shape
    own = np.interp(np.fft.rfftfreq(count, step), frequencies, spectrum, right=0.0)
    white = rng.standard_normal((2, *others, len(own)))
    size = np.sqrt(own * count / step / 4.0)
    return np.fft.irfft((white[0] + 1j * white[1]) * size, count)


def autocovariance(fitted: FittedMachine, signals: Signals, reading: float) -> np.ndarray:
    """Of errors of the speed one ``reading`` (s) ahead, within drives, at 0…LAGS readings, in the
    speed's unit squared."""
    pairs: list[list[np.ndarray]] = [[] for _ in range(LAGS + 1)]
    for own in fitted.predicted(signals, "speed"):
        place = np.round((own.time - own.time[0]) / reading).astype(int)
        error = np.full(place[-1] + 1 + LAGS, np.nan)
        error[place] = own.error
        for lag, some in enumerate(pairs):
            some.append(error[lag:] * error[: len(error) - lag])
    return np.array([np.nanmean(np.concatenate(some)) for some in pairs])


def visible(
    fitted: FittedMachine, signals: Signals, reading: float, frequencies: np.ndarray
) -> np.ndarray:
    """The spectrum of these errors at ``frequencies`` in Hz, by their autocovariance (Blackman and
    Tukey)."""
    covariance = autocovariance(fitted, signals, reading)
    taper = np.hanning(2 * LAGS + 3)[LAGS + 1 : -1]
    waves = np.cos(2.0 * np.pi * reading * np.outer(frequencies, np.arange(1, LAGS + 1)))
    spectrum = covariance[0] + 2.0 * waves @ (taper * covariance)[1:]
    return np.maximum(spectrum, LEAST * covariance[0])


def corrected(
    frequencies: np.ndarray,
    spectrum: np.ndarray,
    wanted: np.ndarray,
    shown: np.ndarray,
    passed: float,
) -> np.ndarray:
    """A disturbance's ``spectrum``, nearer to the one with which errors have the spectrum that is
    ``wanted`` instead of the one ``shown``; above ``passed`` Hz, where little of it shows, its
    median below."""
    nearer = spectrum * wanted / shown
    nearer[frequencies > passed] = np.median(nearer[frequencies <= passed])
    return nearer
