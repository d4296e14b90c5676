"""The EMPS under its own position controller, as a fitted model moves it: records without an error
of the model, of which every finding is a false alarm.

A simulation from the recorded force would be of an open loop.  Here the force answers to the
disturbances, as on the rig.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import casadi as ca
import numpy as np
import pandas as pd
from scipy.io import loadmat
from scipy.ndimage import binary_closing, binary_erosion

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

from convert import WIDTH, filtered  # noqa: E402
from run import force_error, inputs_of, motion  # noqa: E402

from clutchest.identify.fitted_machine import FittedMachine  # noqa: E402

PAST = 4  # positions that the controller makes its speed of
SLOW, STEADY = 0.005, 0.05  # m/s and m/s²: noise is what is left at a steady speed above
BLOCK = 300  # samples of a block of disturbances
STEPS = 4  # of an integration, between two samples


@dataclass(frozen=True)
class Loop:
    """A record (K samples at 1 kHz): ``time`` s, ``goal`` m, ``begin`` m, the fitted model's
    ``inputs`` (nu, K) and the loop's ``step``; ``disturbances`` N (K') of the force and
    ``noises`` V (K) of the controller, to be drawn from in blocks."""

    time: np.ndarray
    goal: np.ndarray
    begin: float
    inputs: np.ndarray
    step: ca.Function
    disturbances: tuple[np.ndarray, ...]
    noises: np.ndarray
    gain: float

    @classmethod
    def of(cls, path: Path, fitted: FittedMachine) -> Loop:
        """The loop of an official file, as a fitted model moves it."""
        record = loadmat(path)
        time, goal, position, voltage = (record[k].ravel() for k in ("t", "qg", "qm", "vir"))
        gain, kp, kv = (record[k].item() for k in ("gtau", "kp", "kv"))
        taps, noises = controller(goal, position, voltage, kp, kv)
        table = motion(filtered(time, position, gain * voltage, every=1))
        error = -force_error(fitted, table)
        steady = (np.abs(table["speed"]) > SLOW) & (np.abs(table["acceleration"]) < STEADY)
        steady = binary_erosion(binary_closing(steady, iterations=WIDTH), iterations=2 * WIDTH)
        edges = np.flatnonzero(np.diff(np.pad(steady.astype(int), 1))).reshape(-1, 2)
        return cls(
            time,
            goal,
            position[0],
            inputs_of(fitted, filled(time, table)),
            loop(fitted, gain, kp, kv, taps),
            tuple(error[a:b] - error[a:b].mean() for a, b in edges if b - a >= BLOCK),
            noises,
            gain,
        )

    def record(self, rng: np.random.Generator) -> pd.DataFrame:
        """A record as the converter gives it, with disturbances drawn anew."""
        count = len(self.time)
        push = blocks(rng, self.disturbances, count)
        return self.moved(push, blocks(rng, (self.noises,), count))

    def moved(self, push: np.ndarray, noise: np.ndarray) -> pd.DataFrame:
        """The record under these forces N (K) and with this noise V (K) of the controller."""
        states = self.step.size1_in(0) - 1 - PAST
        start = np.concatenate([np.zeros(states), np.full(1 + PAST, self.begin)])
        known = np.vstack([self.goal, push, noise, self.inputs])
        _, made = self.step.mapaccum(len(self.time))(start, known)
        position, voltage = np.array(made)
        return filtered(self.time, position, self.gain * voltage)


def controller(
    goal: np.ndarray, position: np.ndarray, voltage: np.ndarray, kp: float, kv: float
) -> tuple[np.ndarray, np.ndarray]:
    """How the recorded voltage V = kv (kp (goal − position) − v̂) makes its speed v̂ of the last
    ``PAST`` steps of the position (1/s); and what it is besides (K), V."""
    changes = np.diff(position, prepend=position[0])
    rows = np.array([np.roll(changes, k) for k in range(PAST)]).T
    speed = kp * (goal - position) - voltage / kv
    taps = np.linalg.lstsq(rows[PAST:], speed[PAST:], rcond=None)[0]
    return taps, kv * (rows @ taps - speed)[PAST:]


def filled(time: np.ndarray, table: Mapping[str, np.ndarray]) -> Mapping[str, np.ndarray]:
    """The columns at other times, constant beyond the table's ends."""
    return {k: np.interp(time, table["time"], column) for k, column in table.items()}


def loop(fitted: FittedMachine, gain: float, kp: float, kv: float, taps: np.ndarray) -> ca.Function:
    """One sample on: states, and ``PAST`` + 1 positions, the newest first; goal, disturbance (N),
    noise (V) and the model's inputs → the next states and positions; position, voltage."""
    model, rates = fitted.posterior.problem.compiled.model, fitted.rates()
    names = [item.name for item in model.inputs]
    x, past = ca.SX.sym("x", len(model.states)), ca.SX.sym("past", 1 + PAST)
    known, state = ca.SX.sym("known", 3 + len(names)), ca.vertcat(x, past)
    goal, push, noise = ca.vertsplit(known[:3])
    speed = ca.dot(ca.DM(taps), past[:-1] - past[1:])
    voltage = kv * (kp * (goal - past[0]) - speed) + noise
    u = known[3:]
    u[names.index("force")], u[names.index("position")] = gain * voltage + push, past[0]
    position, dt, place = past[0], 1e-3 / STEPS, model.state("speed")
    for _ in range(STEPS):
        middle = x + dt / 2.0 * rates(x, u, 1.0)
        x, position = x + dt * rates(middle, u, 1.0), position + dt * middle[place]
    after = ca.vertcat(x, position, past[:-1])
    return ca.Function("loop", [state, known], [after, ca.vertcat(past[0], voltage)])


def blocks(rng: np.random.Generator, pieces: Sequence[np.ndarray], count: int) -> np.ndarray:
    """So many values, in blocks that begin anywhere in the pieces and end in them (count)."""
    begins = [np.arange(len(piece) - BLOCK + 1) for piece in pieces]
    which = np.repeat(np.arange(len(pieces)), [len(each) for each in begins])
    where = np.concatenate(begins)
    drawn = rng.integers(len(where), size=count // BLOCK + 1)
    some = [pieces[which[k]][where[k] : where[k] + BLOCK] for k in drawn]
    return np.concatenate(some)[:count]
