"""Discovers what the textbook's model of the EMPS gets wrong, and what the correction is worth.

python machines/emps/run.py DATA --out DIR: DATA holds the official files; DIR gets result.json,
extended.toml, the report of the first discovery and pictures.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

from convert import convert  # noqa: E402
from two_records import Found, less, rms, run  # noqa: E402

from clutchest.identify.fitted_machine import FittedMachine  # noqa: E402
from clutchest.models.symbols import State  # noqa: E402

# Of the benchmark's report: mass, viscous and dry friction, offset, fitted to the discovery record.
PUBLISHED = {"mass": 95.1089, "viscous": 203.5034, "coulomb": 20.3935, "offset": -3.1648}
STEPS = 20  # of a simulation, between two samples
BLOCK = 100  # samples of a block of the bootstrap


def motion(table: pd.DataFrame) -> Mapping[str, np.ndarray]:
    """The columns of a record, and the acceleration."""
    columns = {name: table[name].to_numpy() for name in table.columns}
    return columns | {"acceleration": np.gradient(columns["speed"], columns["time"])}


def inputs_of(fitted: FittedMachine, record: Mapping[str, np.ndarray]) -> np.ndarray:
    """The inputs of the equations (nu, K)."""
    return np.array([record[item.name] for item in fitted.posterior.problem.compiled.model.inputs])


def states_of(fitted: FittedMachine, record: Mapping[str, np.ndarray]) -> np.ndarray:
    """The speed as measured, the time that curves are over, and other states of effects as they are
    in steady motion (n, K)."""
    speed, since = record["speed"], record["time"] - record["time"][0]

    def measured(state: State) -> np.ndarray:
        """Of one state."""
        if state.name == "speed":
            return speed
        return since if state.unit == "s" else np.sign(speed)

    model = fitted.posterior.problem.compiled.model
    return np.array([measured(state) for state in model.states])


def forces(fitted: FittedMachine, record: Mapping[str, np.ndarray]) -> tuple[np.ndarray, ...]:
    """Forces of the drive, as reported but for an error of it, and of the equations at the measured
    motion (K), N."""
    pair = fitted.quantities("drive_force", "inverse_force")
    states, inputs = states_of(fitted, record), inputs_of(fitted, record)
    drive, inverse = np.array(pair(states, inputs, np.ones((1, states.shape[1]))))
    return drive, inverse


def force_error(fitted: FittedMachine, record: Mapping[str, np.ndarray]) -> np.ndarray:
    """The drive's force less that of the equations (K), N."""
    drive, inverse = forces(fitted, record)
    return drive - inverse


def relative_force_error(fitted: FittedMachine, record: Mapping[str, np.ndarray]) -> np.ndarray:
    """The same over the rms of the drive's force (K), %: a model in which the drive gives less than
    it reports, and all that it moves is as much lighter, is no better for it."""
    drive, inverse = forces(fitted, record)
    return 100.0 * (drive - inverse) / rms(drive)


def speed_error(fitted: FittedMachine, record: Mapping[str, np.ndarray]) -> np.ndarray:
    """Measured speed less that simulated from the measured force alone (K), m/s."""
    rates, inputs = fitted.rates(), inputs_of(fitted, record)
    x, simulated = states_of(fitted, record)[:, 0], []
    on, dt = np.ones(1), float(np.median(np.diff(record["time"]))) / STEPS
    for k in range(inputs.shape[1]):
        simulated.append(x[0])
        ahead = inputs[:, min(k + 1, inputs.shape[1] - 1)]
        for i in range(STEPS):
            u = inputs[:, k] + (i + 0.5) / STEPS * (ahead - inputs[:, k])
            first = np.array(rates(x, u, on)).ravel()
            x = x + dt * np.array(rates(x + dt / 2.0 * first, u, on)).ravel()
    return record["speed"] - np.array(simulated)


def published_force_error(record: Mapping[str, np.ndarray]) -> float:
    """Relative force error of the published numbers on this record."""
    p = PUBLISHED
    dry = p["coulomb"] * np.sign(record["speed"]) + p["offset"]
    made = p["mass"] * record["acceleration"] + p["viscous"] * record["speed"] + dry
    return rms(record["force"] - made) / rms(record["force"])


def scores(before: FittedMachine, after: FittedMachine, record: Mapping[str, np.ndarray]) -> dict:
    """Both machines on one record: force of the inverse model, speed of the simulated one."""
    force = [relative_force_error(each, record) for each in (before, after)]
    speed = [speed_error(each, record) for each in (before, after)]
    return {
        "force_error_percent": {
            "published_base": 100.0 * published_force_error(record),
            "before": rms(force[0]),
            "after": rms(force[1]),
            "less_ci95": less(*force, BLOCK),
        },
        "simulated_speed_rmse_m_s": {
            "before": rms(speed[0]),
            "after": rms(speed[1]),
            "less_ci95": less(*speed, BLOCK),
        },
    }


def draw(before: FittedMachine, after: FittedMachine, record: Mapping, path: Path) -> None:
    """Friction against speed: what the force leaves when the mass is moved, and both models."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(10, 4), constrained_layout=True)
    for axis, fitted, title in zip(axes, (before, after), ("textbook", "extended"), strict=True):
        error, steady = force_error(fitted, record), np.abs(record["acceleration"]) < 0.05
        axis.plot(record["speed"][steady], error[steady], ".", markersize=2)
        axis.set(xlabel="speed [m/s]", ylabel="force, measured − model [N]", title=title)
        axis.set_ylim(-12.0, 12.0)
        axis.grid(alpha=0.3)
    figure.savefig(path, dpi=110)


def judge(found: Found, out: Path) -> Mapping[str, Any]:
    """Force and speed on the pulse record."""
    records = [motion(table) for table in found.tables]
    draw(found.before, found.after, records[0], out / "friction.png")
    held = scores(found.before, found.after, records[1])
    first = scores(found.before, found.first, records[1])
    return {
        "rmse_before": held["force_error_percent"]["before"],
        "rmse_after": held["force_error_percent"]["after"],
        "rmse_of": "force on the pulse record, % of its rms",
        "held_out": held,
        "held_out_first": first,
    }


if __name__ == "__main__":
    run(
        __doc__,
        HERE / "emps.toml",
        convert,
        judge,
        ("verdict", "where", "held_out", "seconds"),
    )
