"""The EMPS under its own position controller, at 1 kHz, as a fitted model moves it: records without
an error of the model, of which every finding is a false alarm.

The plant is the fitted model, the controller the published one; a stationary force disturbs the
carriage.  Its spectrum is that with which the program's innovations of such records have the
variance and the autocorrelation of its innovations of the measured one.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import casadi as ca
import numpy as np
import pandas as pd
from scipy.io import loadmat

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

import coloured_noise  # noqa: E402
from convert import WIDTH, filtered  # noqa: E402

from clutchest.identify.fitted_machine import FittedMachine  # noqa: E402
from clutchest.signals import Signals  # noqa: E402

SAMPLE = 1e-3  # s, of the controller
STEPS = 10  # of an integration, in a sample
RESOLUTION = 5e-8  # m, of the encoder as recorded
READING = 0.01  # s, from one reading of the converted record to the next
PASSED = 48.0  # Hz, above which nothing of the disturbance passes the converter's filter
FREQUENCIES = np.linspace(0.0, 500.0, 501)  # Hz
INITIAL = 1e-3  # N²/Hz, the spectrum that the search begins with
TURNS, DRAWS = 6, 4  # of the search, and records of each


@dataclass(frozen=True)
class Loop:
    """A record of ``time`` (K) s and ``goal`` (K) m at 1 kHz: ``moves`` leads from the ``start`` to
    what encoder and amplifier report, at a goal and a disturbance of every sample."""

    time: np.ndarray
    goal: np.ndarray
    start: np.ndarray
    moves: ca.Function

    @classmethod
    def of(cls, path: Path, fitted: FittedMachine) -> Loop:
        """That of an official file, as a fitted model moves it."""
        official = loadmat(path)
        time, goal, begin = (official[name].ravel() for name in ("t", "qg", "qm"))
        volts, kp, kv = (official[name].item() for name in ("gtau", "kp", "kv"))
        model = fitted.posterior.problem.compiled.model
        once = _sample(fitted, volts * kv, kp)
        x = np.zeros(len(model.states))
        # curves over time begin where the converted record does
        late = [state.unit == "s" for state in model.states]
        x[late] = time[0] - time[WIDTH]
        start = np.concatenate([x, np.full(3, begin[0]), [official["vir"][0, 0] * volts]])
        return cls(time, goal, start, once.mapaccum("moves", len(time)))

    def moved(self, disturbance: np.ndarray) -> pd.DataFrame:
        """A record with this force (K) N on the carriage, as the converter gives it."""
        _, reported = self.moves(self.start, np.vstack([self.goal, disturbance]))
        position, force = np.array(reported)
        return filtered(self.time, position, force)

    def drawn(self, spectrum: np.ndarray, seed: int) -> pd.DataFrame:
        """The same with noise of a ``spectrum`` N²/Hz at the ``FREQUENCIES``."""
        rng, shape = np.random.default_rng(seed), (len(self.time),)
        return self.moved(coloured_noise.drawn(FREQUENCIES, spectrum, SAMPLE, shape, rng))


def _sample(fitted: FittedMachine, gain: float, kp: float) -> ca.Function:
    """One sample: states, position, the last two readings of it and the last force; goal and
    disturbance → the same one sample later; position and force as they are recorded.

    force = ``gain`` · (``kp`` · (goal − position) − speed), the speed over two samples: it gives
    the recorded one back to 0.13 N.  It acts until the next sample, and is recorded as its mean
    around each.
    """
    model, rates = fitted.posterior.problem.compiled.model, fitted.rates()
    n, of = len(model.states), [item.name for item in model.inputs]
    begin, given = ca.SX.sym("x", n + 4), ca.SX.sym("given", 2)
    x, position, dt = begin[:n], begin[n], SAMPLE / STEPS
    read = ca.floor(position / RESOLUTION + 0.5) * RESOLUTION
    speed = (read - begin[n + 2]) / (2.0 * SAMPLE)
    force = gain * (kp * (given[0] - read) - speed)
    row = [state.name for state in model.states].index("speed")
    for _ in range(STEPS):
        known = {"force": force - given[1], "position": position}
        u = ca.vertcat(*(known.get(name, 0.0) for name in of))
        slope = rates(x, u, 1.0)
        ahead = x + dt * (slope + rates(x + dt * slope, u, 1.0)) / 2.0
        position += dt * (x[row] + ahead[row]) / 2.0
        x = ahead
    end = ca.vertcat(x, position, read, begin[n + 1], force)
    reported = ca.vertcat(read, (begin[n + 3] + force) / 2.0)
    return ca.Function("sample", [begin, given], [end, reported])


def spectrum_of(
    loop: Loop, fitted: FittedMachine, signals: Signals, read: Callable[[pd.DataFrame], Signals]
) -> np.ndarray:
    """The spectrum, N²/Hz at the ``FREQUENCIES``, of the disturbance that gives innovations of the
    model, ``fitted`` anew to each record, the autocovariance of those of the ``signals``;
    ``read``: a converted table as signals."""
    wanted, spectrum = _visible(fitted, signals), np.full(len(FREQUENCIES), INITIAL)
    for turn in range(TURNS):
        own = [read(loop.drawn(spectrum, 1_000_000 + turn * DRAWS + k)) for k in range(DRAWS)]
        made = [_visible(FittedMachine.of(each, fitted.vehicle), each) for each in own]
        shown = np.mean(made, axis=0)
        spectrum = coloured_noise.corrected(FREQUENCIES, spectrum, wanted, shown, PASSED)
    return spectrum


def _visible(fitted: FittedMachine, signals: Signals) -> np.ndarray:
    """The spectrum of the innovations at the ``FREQUENCIES``."""
    return coloured_noise.visible(fitted, signals, READING, FREQUENCIES)
