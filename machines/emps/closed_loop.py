"""The EMPS under its own position controller, as a fitted model moves it: records without an error
of the model, of which every finding is a false alarm.

A simulation from the recorded force would be of an open loop.  Here the force answers to what the
position and the speed read, as on the rig.  Noise enters as what the fitted model leaves of each
reading when it is predicted one step ahead, and states are corrected by it as the filter does (the
model in innovations form).  Of the measured record it does not give the colour yet that the program
sees there (docs/machines.md).
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import casadi as ca
import numpy as np
import pandas as pd
from scipy.io import loadmat
from scipy.optimize import newton

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

from convert import filtered, table  # noqa: E402
from run import inputs_of, motion, states_of  # noqa: E402

from clutchest.identify.fitted_machine import FittedMachine  # noqa: E402

PAST = 4  # speeds that the controller's is made of
BLOCK = 32  # readings of a block of noise: 0.3 s
STEPS = 20  # of an integration, between two readings
EXACT = 1e-6  # N, to which the force and the speed that it answers to agree


@dataclass(frozen=True)
class Controller:
    """force = ``gain`` · (``kp`` · (goal − position) − ``taps`` (PAST) · speeds, the newest first):
    N per m/s, and 1/s."""

    gain: float
    kp: float
    taps: np.ndarray

    @classmethod
    def of(cls, record: Mapping[str, np.ndarray], gain: float, kp: float) -> Controller:
        """That of a record with ``goal``, ``position``, ``speed`` and ``force`` (K)."""
        wanted = kp * (record["goal"] - record["position"]) - record["force"] / gain
        return cls(gain, kp, np.linalg.lstsq(past(record["speed"]), wanted, rcond=None)[0])

    def force(self, ahead: np.ndarray, speeds: np.ndarray) -> np.ndarray:
        """N (…) at a goal that is ``ahead`` (…) m, and ``speeds`` (…, PAST)."""
        return self.gain * (self.kp * ahead - speeds @ self.taps)


@dataclass(frozen=True)
class Noise:
    """Of every reading (K): what the ``speed`` is beside the prediction, m/s, the ``position``
    beside the speed's integral, m, and the ``force`` beside the controller's, N."""

    speed: np.ndarray
    position: np.ndarray
    force: np.ndarray

    def drawn(self, rng: np.random.Generator) -> Noise:
        """The same anew: blocks that begin anywhere, on a circle."""
        count = len(self.speed)
        begins = rng.integers(count, size=count // BLOCK + 1)
        rows = (begins[:, None] + np.arange(BLOCK)).ravel()[:count] % count
        return Noise(self.speed[rows], self.position[rows], self.force[rows])


@dataclass(frozen=True)
class Loop:
    """A ``record`` (K readings at 100 Hz) with its goal; the fitted model's ``inputs`` (nu, K), of
    which the force is one, its ``step`` from one reading to the next, from ``start`` (n) on, and
    the filter's ``gain`` (n, K)."""

    record: Mapping[str, np.ndarray]
    inputs: np.ndarray
    force: int
    step: ca.Function
    start: np.ndarray
    gain: np.ndarray
    controller: Controller

    @classmethod
    def of(cls, path: Path, fitted: FittedMachine) -> Loop:
        """The loop of an official file, as a fitted model moves it."""
        official = loadmat(path)
        time, goal = official["t"].ravel(), official["qg"].ravel()
        volts, kp, kv = (official[k].item() for k in ("gtau", "kp", "kv"))
        record = {**motion(table(path)), "goal": filtered(time, goal, goal)["position"].to_numpy()}
        names = [item.name for item in fitted.posterior.problem.compiled.model.inputs]
        return cls(
            record,
            inputs_of(fitted, record),
            names.index("force"),
            stepped(fitted, period_of(record)),
            states_of(fitted, record)[:, 0],
            gains_of(fitted),
            Controller.of(record, volts * kv, kp),
        )

    def noise(self) -> Noise:
        """That of the record."""
        goal, position, speed, force = (
            self.record[name] for name in ("goal", "position", "speed", "force")
        )
        x, off = self.start, np.zeros(len(speed))
        for k, reading in enumerate(speed):
            if k:
                x = self._ahead(x, k, force[k - 1], force[k])
            off[k] = reading - x[0]
            x = x + self.gain[:, k] * off[k]
        moved = period_of(self.record) * (speed[1:] + speed[:-1]) / 2.0
        made = self.controller.force(goal - position, past(speed))
        drift = np.diff(position, prepend=position[0]) - np.append(0.0, moved)
        return Noise(off, drift, force - made)

    def moved(self, noise: Noise) -> pd.DataFrame:
        """A record with this noise, as the converter gives it."""
        goal, half = self.record["goal"], period_of(self.record) / 2.0
        position, speed, force = (
            np.full(len(goal), self.record[name][0]) for name in ("position", "speed", "force")
        )
        x = self.start + self.gain[:, 0] * noise.speed[0]
        for k in range(1, len(goal)):

            def excess(answer: float, x: np.ndarray = x, k: int = k) -> float:
                """The force that the controller gives beyond the one that it answers to, N."""
                speed[k] = self._ahead(x, k, force[k - 1], answer)[0] + noise.speed[k]
                position[k] = position[k - 1] + half * (speed[k] + speed[k - 1]) + noise.position[k]
                newest = speed[np.maximum(np.arange(k, k - PAST, -1), 0)]
                made = self.controller.force(goal[k] - position[k], newest)
                return float(made + noise.force[k] - answer)

            force[k] = newton(excess, force[k - 1], tol=EXACT)
            excess(force[k])
            x = self._ahead(x, k, force[k - 1], force[k]) + self.gain[:, k] * noise.speed[k]
        columns = {"position": position, "speed": speed, "force": force}
        return pd.DataFrame({"time": self.record["time"], **columns})

    def _ahead(self, x: np.ndarray, k: int, before: float, force: float) -> np.ndarray:
        """The states (n) carried from reading k − 1 to k by a force that changes evenly."""
        u = self.inputs[:, k - 1 : k + 1].copy()
        u[self.force] = before, force
        return np.array(self.step(x, u)).ravel()


def period_of(record: Mapping[str, np.ndarray]) -> float:
    """s from one reading to the next."""
    return float(np.median(np.diff(record["time"])))


def stepped(fitted: FittedMachine, period: float) -> ca.Function:
    """The states (n), and inputs (nu, 2) at both ends of a ``period`` s → the states at its end."""
    model, rates = fitted.posterior.problem.compiled.model, fitted.rates()
    begin, u = ca.SX.sym("x", len(model.states)), ca.SX.sym("u", len(model.inputs), 2)
    x, dt = begin, period / STEPS
    for i in range(STEPS):
        first, last = (u[:, 0] + (i + s) / STEPS * (u[:, 1] - u[:, 0]) for s in (0.0, 1.0))
        slope = rates(x, first, 1.0)
        x = x + dt / 2.0 * (slope + rates(x + dt * slope, last, 1.0))
    return ca.Function("step", [begin, u], [x])


def past(speed: np.ndarray) -> np.ndarray:
    """Speeds (K, PAST): each reading and those before."""
    padded = np.pad(speed, (PAST - 1, 0), mode="edge")
    return np.lib.stride_tricks.sliding_window_view(padded, PAST)[:, ::-1]


def gains_of(fitted: FittedMachine) -> np.ndarray:
    """By what the filter corrects each state after each reading (n, K)."""
    [drive] = fitted.posterior.problem.drives
    reads = drive.line.sensor >= 0
    gain = np.zeros((len(drive.tracked.which), np.count_nonzero(reads)))
    gain[drive.tracked.which] = drive.gains.gain[reads].T
    return gain
