"""Records in the layout of the official files, of a carriage whose viscous friction differs by
direction.

A program of its own: it shares no equations with emps.py.  For tests, and to see what the log of a
rig of one's own should look like.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from scipy.io import savemat

GAIN, PERIOD, STEPS = 35.15, 0.001, 4  # N/V; s between samples, and steps in between
MASS, DRY, OFFSET = 95.0, 20.0, -3.0  # kg, N, N
VISCOUS = {1: 180.0, -1: 230.0}  # N s/m forwards and backwards
PROPORTIONAL, DERIVATIVE = 160.0, 243.0  # of the controller: 1/s, V s/m


def reference(duration: float) -> np.ndarray:
    """Positions (m) of moves to and fro at four speeds."""
    speed = np.zeros(round(duration / PERIOD))
    for i, begin in enumerate(np.arange(0.2, duration - 1.0, 1.5)):
        top = (0.125, -0.125, 0.07, -0.07, 0.03, -0.03)[i % 6]
        some = slice(round(begin / PERIOD), round((begin + 1.4) / PERIOD))
        phase = np.linspace(0.0, 1.0, some.stop - some.start)[: len(speed[some])]
        speed[some] = top * np.clip(5.0 * np.minimum(phase, 1.0 - phase), 0.0, 1.0)
    return np.cumsum(speed) * PERIOD


def record(rng: np.random.Generator, duration: float, pulses: bool) -> dict[str, np.ndarray]:
    """A closed-loop record as the official files hold it."""
    goal = reference(duration)
    x, v, positions, voltages = goal[0], 0.0, [], []
    for k, wanted in enumerate(goal):
        read = x + 1e-7 * rng.standard_normal()
        demand = PROPORTIONAL * (wanted - read)
        voltage = DERIVATIVE * (demand - v)
        voltage += 5.0 * (pulses and k // 500 % 2 == 1)
        voltage = np.clip(voltage, -10.0, 10.0)
        positions.append(read)
        voltages.append(voltage)
        for _ in range(STEPS):
            way = 1 if v > 0 else -1
            force = GAIN * voltage + 1.0 * rng.standard_normal() - OFFSET - VISCOUS[way] * v
            moved = v + PERIOD / STEPS * force / MASS
            brake = PERIOD / STEPS * DRY / MASS  # stops it at most
            v = np.sign(moved) * max(abs(moved) - brake, 0.0)
            x += PERIOD / STEPS * v
    time = PERIOD * np.arange(len(goal))
    columns = {"t": time, "qm": positions, "qg": goal, "vir": voltages}
    known = {"gtau": GAIN, "kp": PROPORTIONAL, "kv": DERIVATIVE}
    return known | {k: np.reshape(c, (-1, 1)) for k, c in columns.items()}


def generate(folder: Path, seed: int = 0, duration: float = 24.8) -> None:
    """Write both files into a folder."""
    rng = np.random.default_rng(seed)
    savemat(folder / "DATA_EMPS.mat", record(rng, duration, pulses=False))
    savemat(folder / "DATA_EMPS_PULSES.mat", record(rng, duration, pulses=True))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    generate(options.folder, options.seed)
