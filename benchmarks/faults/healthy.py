"""Whole healthy drives, each of another truck: simulated, decoded from its bus, and tested."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

import clutchest
from clutchest.diagnosis.drive_diagnosis import DriveDiagnosis
from clutchest.diagnosis.recursive_residuals import onset_scores
from clutchest.models import machine_of

Task = tuple[str, str, int, str, Path]  # vehicle, scenario, seed, heat, folder
DURATION = 1800.0  # s
SCENARIOS = ("city", "launches", "heating")
HOT, DRIVING = ("heating", "cooldown"), ("city", "launches")
# Heat conditions beyond the spreads of the vehicle file, by one standard deviation of healthy
# vehicles: no fault, and no monitor may fail by them.
# A clutch that is worn, but within its limit by three spreads of its zero position, is healthy too;
# other monitors may report that it is not new, so that only `wear` is counted.
HEAT: dict[str, dict[str, dict[str, float]]] = {
    "within its spreads": {},
    "gearbox": {"transmission_heat_path": {"conductance": 15.0}},
    "coolant": {"coolant_coupling": {"change": 0.5}},
    "airflow": {"housing_airflow": {"slope": 0.75}},
    "worn": {"wear": {"amount": 2.4}},
}


def scenarios(heat: str) -> tuple[str, str]:
    """Scenarios in which this has an effect: airflow needs a moving truck."""
    return DRIVING if heat == "airflow" else HOT


def record(task: Task) -> Path:
    """Test one drive and record the results; an existing record is kept."""
    vehicle, scenario, seed, heat, out = task
    path = out / f"{scenario}-{seed}-{heat.replace(' ', '_')}.npz"
    if path.is_file():
        return path
    truck = clutchest.load_vehicle(vehicle)
    signals = clutchest.simulate(truck, scenario, seed, HEAT[heat], duration=DURATION)
    run = clutchest.replay(signals, truck)
    drive = DriveDiagnosis.of(run, run.signals, run.tracks[0])
    results = drive.equations
    if results is None:
        raise SystemExit(f"{path.name}: {drive.why_not}")
    blocks, residuals = results.blocks, results.residuals
    whole = onset_scores(blocks, results.columns, residuals.before, 0, len(blocks))
    failed = [r.fault.name for r in results.faults if r.detected is not None]
    failed += ["misfit"] if results.misfit_detected is not None else []
    failed += ["wear"] if drive.wear.status == "failed" else []
    tests = drive.streams.tests
    unfinished = path.with_suffix(".part.npz")
    np.savez_compressed(
        unfinished,
        begin=blocks.begin,
        end=blocks.end,
        count=blocks.count,
        z=residuals.z.astype("f4"),
        information=residuals.information.astype("f4"),
        chi_square=residuals.chi_square.astype("f4"),
        score=whole.score.astype("f4"),
        total=np.diagonal(whole.information, axis1=1, axis2=2).astype("f4"),
        failed=np.array([*failed, *(t.name for t in tests if t.alarms)], "U40"),
        ran=np.array(
            [
                *(r.fault.name for r in results.faults if r.status != "not run"),
                "misfit",
                *(["wear"] if drive.wear.status != "not run" else []),
                *(t.name for t in tests if t.threshold is not None),
            ],
            "U40",
        ),
        provenance=json.dumps(run.provenance),
    )
    unfinished.rename(path)
    return path


def tally(folder: Path) -> dict[str, Any]:
    """Of every record in ``folder``, by heat condition: hours in which each monitor ran and in how
    many drives it failed; and the score of each fault over whole drives in standard deviations,
    which in healthy drives has mean 0 and a standard deviation of 1 at most."""
    faults = machine_of("dry_clutch").faults
    rows: dict[str, Any] = {}
    for heat in HEAT:
        ran: Counter[str] = Counter()
        failed: Counter[str] = Counter()
        whole = []
        drives = sorted(folder.glob(f"*-{heat.replace(' ', '_')}.npz"))
        for path in drives:
            with np.load(path) as of:
                ran.update(of["ran"].tolist())
                failed.update(of["failed"].tolist())
                total = of["total"][-1]
                score = of["score"][-1]
                whole.append(np.where(total > 0.0, score / np.sqrt(total.clip(1e-12)), 0.0))
        monitors = ["wear"] if heat == "worn" else sorted(ran)
        if drives:
            rows[heat] = {
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
                    for fault, z in zip(faults, np.array(whole).T, strict=True)
                },
            }
    return rows
