"""The filter on the generator's drives: is the truth where the filter says?

The generator is a separate program, with its own integrator; its bus is quantised, its parameters
are drawn from the spreads in the vehicle file.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from statistic import interval, line, shown

import clutchest
from clutchest.simulated import Options
from clutchest.vehicle import Vehicle

LEAST = 0.90  # of the time, the truth must lie within the 95 % interval


def coloured(vehicle: Vehicle, ar: float) -> Vehicle:
    """The vehicle whose file says that all noise is coloured."""
    signals = {name: replace(signal, noise_ar=ar) for name, signal in vehicle.signals.items()}
    return replace(vehicle, signals=signals)


# case → AR(1) coefficient of all noise or None for the file's, share of outliers
CASES: dict[str, tuple[float | None, float]] = {
    "as the vehicle file says": (None, 0.0),
    "AR(1) noise of 0.5": (0.5, 0.0),
    "AR(1) noise of 0.9": (0.9, 0.0),
    "2 % outliers": (None, 0.02),
}


def drive(task: tuple[str, str, str, int]) -> dict[str, Any]:
    """One drive: per state the share of time in the 95 % interval, mean squares of error and
    stated standard deviation; per sensor the mean NIS."""
    name, case, scenario, seed = task
    vehicle = clutchest.load_vehicle(name)
    ar, outliers = CASES[case]
    options: Options = {"outliers": outliers}
    if ar is not None:
        vehicle, options = coloured(vehicle, ar), {**options, "noise_ar": ar}
    signals = clutchest.simulate(vehicle, scenario, seed, **options)
    run = clutchest.replay(signals, vehicle)
    track, truth = run.tracks[0], signals.truth
    assert truth is not None
    found: dict[str, Any] = {"case": case, "scenario": scenario, "states": {}}
    for state, estimate in {**track.states, "clutch_torque": track.clutch_torque}.items():
        error = estimate.value - np.interp(track.time, truth.time, truth.columns[state])
        inside, std = np.abs(error) <= 1.96 * estimate.std, estimate.std
        if state == "clutch_torque":  # an open clutch passes none, and that is no achievement
            closed = track.mode != track.mode_names.index("open")
            inside, error, std = inside[closed], error[closed], std[closed]
        found["states"][state] = [np.mean(inside), np.mean(error**2), np.mean(std**2)]
    found["nis"] = {key: s["nis_mean"] for key, s in run.summary["sensors"].items()}
    return found


def table(results: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Per case and state: coverage with its interval, RMSE and stated σ over all drives, and
    coverage by scenario; per case NIS."""
    out: dict[str, Any] = {}
    for case in dict.fromkeys(r["case"] for r in results):
        of = [r for r in results if r["case"] == case]
        scenario = np.array([r["scenario"] for r in of])
        states = {}
        for name in of[0]["states"]:
            values = np.array([r["states"][name] for r in of])
            states[name] = {
                "coverage": _share(values),
                "rmse": float(np.sqrt(values[:, 1].mean())),
                "stated": float(np.sqrt(values[:, 2].mean())),
                "scenarios": {s: _share(values[scenario == s]) for s in dict.fromkeys(scenario)},
            }
        out[case] = {
            "drives": len(of),
            "states": states,
            "nis": {key: float(np.mean([r["nis"][key] for r in of])) for key in of[0]["nis"]},
        }
    return out


def _share(values: NDArray[np.float64]) -> dict[str, float]:
    """Coverage over drives, ``values`` (drives, 3) as :func:`drive` gives them."""
    return interval(values[:, :1], lambda s: s[..., 0])


def show(found: dict[str, Any]) -> str:
    """The table as text."""
    lines = [
        "the generator's drives: RMSE, stated standard deviation, and the share of the time "
        "that the truth lies in the 95 % interval [95 % interval of that share]"
    ]
    for case, c in found.items():
        nis = ", ".join(f"{key} {value:.2f}" for key, value in c["nis"].items())
        lines.append(f"{case}, {c['drives']} drives; NIS {nis}")
        scenarios = list(next(iter(c["states"].values()))["scenarios"])
        lines.append(line("", ("RMSE", "stated", "all", *scenarios), 22))
        for name, s in c["states"].items():
            shares = [s["coverage"], *s["scenarios"].values()]
            cells = (f"{s['rmse']:.4g}", f"{s['stated']:.4g}", *map(shown, shares))
            low = any(share["value"] < LEAST for share in shares)
            lines.append(line(name, cells, 22) + ("  LOW" if low else ""))
    return "\n".join(lines)
