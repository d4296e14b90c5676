"""Whole healthy drives, each of another truck: simulated, read over its bus, judged as a log is."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

import clutchest
from clutchest.diagnosis.drive import Drive
from clutchest.diagnosis.faults import model_faults
from clutchest.diagnosis.predicted import since

Task = tuple[str, str, int, str, Path]  # vehicle, scenario, seed, heat, folder
DURATION = 1800.0  # s
SCENARIOS = ("city", "launches", "heating")
HOT, DRIVING = ("heating", "cooldown"), ("city", "launches")
# What heat does beyond the spreads of the vehicle file, by one standard deviation of healthy
# vehicles: no fault, and no monitor may fail by it.
# A clutch that is worn, but within its limit by three spreads of its zero position, is healthy too;
# that it is not new is for others to say, so that only `wear` is asked.
HEAT: dict[str, dict[str, dict[str, float]]] = {
    "within its spreads": {},
    "gearbox": {"transmission_heat_path": {"conductance": 15.0}},
    "coolant": {"coolant_coupling": {"change": 0.5}},
    "airflow": {"housing_airflow": {"slope": 0.75}},
    "worn": {"wear": {"amount": 2.4}},
}


def scenarios(heat: str) -> tuple[str, str]:
    """Where this shows: wind needs a truck that drives."""
    return DRIVING if heat == "airflow" else HOT


def record(task: Task) -> Path:
    """Judge one drive and keep what came out; a record that is there already is kept."""
    vehicle, scenario, seed, heat, out = task
    path = out / f"{scenario}-{seed}-{heat.replace(' ', '_')}.npz"
    if path.is_file():
        return path
    truck = clutchest.load_vehicle(vehicle)
    signals = clutchest.simulate(truck, scenario, seed, HEAT[heat], duration=DURATION)
    run = clutchest.replay(signals, truck)
    drive = Drive.of(run, run.signals, run.tracks[0])
    watched = drive.watched
    if watched is None:
        raise SystemExit(f"{path.name}: {drive.why_not}")
    blocks, residuals = watched.blocks, watched.residuals
    whole = since(blocks, watched.columns, residuals.before, 0, len(blocks))
    failed = [j.fault.name for j in watched.faults if j.detected is not None]
    failed += ["misfit"] if watched.misfit_detected is not None else []
    failed += ["wear"] if drive.wear[1] == "failed" else []
    tests = drive.streams.tests
    unfinished = path.with_suffix(".part.npz")
    np.savez_compressed(
        unfinished,
        begin=blocks.begin,
        end=blocks.end,
        count=blocks.count,
        z=residuals.z.astype("f4"),
        information=residuals.information.astype("f4"),
        surprise=residuals.surprise.astype("f4"),
        score=whole.score.astype("f4"),
        told=np.diagonal(whole.information, axis1=1, axis2=2).astype("f4"),
        failed=np.array([*failed, *(t.name for t in tests if t.alarms)], "U40"),
        ran=np.array(
            [
                *(j.fault.name for j in watched.faults if j.status != "not run"),
                "misfit",
                *(["wear"] if drive.wear[1] != "not run" else []),
                *(t.name for t in tests if t.threshold is not None),
            ],
            "U40",
        ),
        provenance=json.dumps(run.provenance),
    )
    unfinished.rename(path)
    return path


def tally(folder: Path) -> dict[str, Any]:
    """Of every record in ``folder``, by what heat does: in how many hours each monitor ran and how
    often it failed in them; and what each drive as a whole says of each fault in standard
    deviations, which in health has mean 0 and a standard deviation of 1 at most."""
    found: dict[str, Any] = {}
    for heat in HEAT:
        ran: Counter[str] = Counter()
        failed: Counter[str] = Counter()
        whole = []
        drives = sorted(folder.glob(f"*-{heat.replace(' ', '_')}.npz"))
        for path in drives:
            with np.load(path) as of:
                ran.update(of["ran"].tolist())
                failed.update(of["failed"].tolist())
                told = of["told"][-1]
                whole.append(np.where(told > 0.0, of["score"][-1] / np.sqrt(told.clip(1e-12)), 0.0))
        monitors = ["wear"] if heat == "worn" else sorted(ran)
        if drives:
            found[heat] = {
                "drives": len(drives),
                "hours": len(drives) * DURATION / 3600.0,
                "ran_h": {name: ran[name] * DURATION / 3600.0 for name in monitors},
                "alarms": {name: failed[name] for name in monitors if failed[name]},
                "whole_drives": {}
                if heat == "worn"
                else {
                    fault.name: {
                        "mean": round(float(z.mean()), 2),
                        "std": round(float(z.std()), 2),
                        "largest": round(float(np.abs(z).max()), 2),
                    }
                    for fault, z in zip(model_faults("dry_clutch"), np.array(whole).T, strict=True)
                },
            }
    return found
