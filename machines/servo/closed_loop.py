"""The servo's runs under its own controller, as a fitted model moves the arm: records without an
error of the model, of which every finding is a false alarm.

A stationary acceleration disturbs the arm.  Its spectrum is that with which the program's
innovations of such records have the variance and the autocorrelation of its innovations of the
measured one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from convert import EVERY, SCALE, SIGN, table
from run import STEP, Bench, by_machine, controller

from clutchest.identify.fitted_machine import FittedMachine
from clutchest.signals import Signals

READING = EVERY * STEP  # s
LAGS = 24  # readings, over which innovations are compared
FREQUENCIES = np.linspace(0.0, 0.5 / READING, 101)  # Hz
PASSED = 10.0  # Hz, above which little of the disturbance passes the converter's means over 40 ms
INITIAL = 1.0  # rad²/s³, the spectrum that the search begins with
TURNS = 6  # of the search, each with a record
LEAST = 0.02  # of the variance of innovations: smaller spectra are not told from it


@dataclass(frozen=True)
class Loop:
    """The ``runs`` of a record on a ``bench``, as a ``fitted`` model moves them to goals that
    arrive ``late`` steps later and are aimed at by ``rate`` rad/s at most, disturbed by an
    acceleration of a ``spectrum`` (rad/s²)²/Hz at the FREQUENCIES."""

    runs: Sequence[pd.DataFrame]
    bench: Bench
    fitted: FittedMachine
    late: int
    rate: float
    spectrum: np.ndarray

    @classmethod
    def of(cls, runs: Sequence[pd.DataFrame], fitted: FittedMachine) -> Loop:
        """Those of a record, by its own controller."""
        bench = Bench(list(runs))
        late, rate, _ = controller(bench)
        return cls(runs, bench, fitted, late, rate, np.full(len(FREQUENCIES), INITIAL))

    def disturbance(self, seed: int) -> np.ndarray:
        """rad/s² (steps, runs)."""
        rng, (steps, count) = np.random.default_rng(seed), self.bench.goal.shape
        at = np.fft.rfftfreq(steps, STEP)
        own = np.interp(at, FREQUENCIES, self.spectrum, right=0.0)
        white = rng.standard_normal((2, count, len(own)))
        size = np.sqrt(own * steps / STEP / 4.0)
        return np.fft.irfft((white[0] + 1j * white[1]) * size, steps).T

    def drawn(self, seed: int) -> list[pd.DataFrame]:
        """Tables of the runs, as the converter gives them."""
        pushed = self.disturbance(seed)
        position, duty = by_machine(self.bench, self.fitted, self.late, self.rate, pushed)
        on = np.array([self.bench.switched(k, self.late) for k in range(len(position))])
        reported = np.where(duty > 0.0, SIGN + duty / SCALE, -duty / SCALE)
        made = []
        for i, run in enumerate(self.runs):
            own = {"position_rad": position, "torque": reported, "torque_enabled": on}
            columns = {name: value[: len(run), i] for name, value in own.items()}
            made.append(table(run.reset_index(drop=True).assign(**columns)))
        return made

    def as_noisy(self, signals: Signals, read: Callable[[Sequence[pd.DataFrame]], Signals]) -> Loop:
        """One whose draws have innovations, of the model fitted anew, of the autocovariance of
        those of the ``signals``; ``read``: tables as signals."""
        loop, wanted = self, visible(autocovariance(self.fitted, signals))
        for turn in range(TURNS):
            made = read(loop.drawn(1_000_000 + turn))
            own = FittedMachine.of(made, self.fitted.vehicle)
            shown = visible(autocovariance(own, made))
            spectrum = loop.spectrum * wanted / shown
            spectrum[FREQUENCIES > PASSED] = np.median(spectrum[FREQUENCIES <= PASSED])
            loop = replace(loop, spectrum=spectrum)
        return loop


def autocovariance(fitted: FittedMachine, signals: Signals) -> np.ndarray:
    """Of errors of the speed one reading ahead, within runs, at 0…LAGS readings, (rad/s)²."""
    pairs: list[list[np.ndarray]] = [[] for _ in range(LAGS + 1)]
    for own in fitted.predicted(signals, "speed"):
        place = np.round((own.time - own.time[0]) / READING).astype(int)
        error = np.full(place[-1] + 1 + LAGS, np.nan)
        error[place] = own.error
        for lag, some in enumerate(pairs):
            some.append(error[lag:] * error[: len(error) - lag])
    return np.array([np.nanmean(np.concatenate(some)) for some in pairs])


def visible(covariance: np.ndarray) -> np.ndarray:
    """The spectrum of an autocovariance at the FREQUENCIES (Blackman and Tukey)."""
    taper = np.hanning(2 * LAGS + 3)[LAGS + 1 : -1]
    waves = np.cos(2.0 * np.pi * READING * np.outer(FREQUENCIES, np.arange(1, LAGS + 1)))
    spectrum = covariance[0] + 2.0 * waves @ (taper * covariance)[1:]
    return np.maximum(spectrum, LEAST * covariance[0])
