"""Fault tests of the differential: false alarms of whole healthy runs, and injected faults.

    python benchmarks/faults/differential.py --out FOLDER [--healthy 40] [--injected 12]

Every run is of another specimen, drawn from the spreads of the vehicle file.  Of a fault, every
second seed has it from the start, the others from a time within the run on.  A motor that jams
changes no number of the equations: such runs, in all scenarios, go through all that ``clutchest
diagnose`` does.  Records in FOLDER are kept, so that it continues where it was stopped, and shards
may share it.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binomtest

sys.path.insert(0, str(Path(__file__).parent.parent))  # what benchmarks share is a file beside

import residuals
from differential_runs import DURATION, SCENARIOS, vehicle_of
from outside_faults import DriftingAngle, JammedMotor

import clutchest
from clutchest.diagnosis.blocks import blocks_at, problem_of
from clutchest.diagnosis.drive_diagnosis import effects_for
from clutchest.diagnosis.fault_tests import FaultTestResults, run_fault_tests
from clutchest.diagnosis.isolation import explanations, not_excluded, separability
from clutchest.diagnosis.streams import StreamTests
from clutchest.signals import Signals
from clutchest.vehicle import load_vehicle

ONSET = (15.0, 35.0)  # s, between which a fault begins within a run
# fault → sizes, in turn
CASES: dict[str, tuple[float, ...]] = {
    "angle_offset": (0.1, -0.2),
    "ball_ramp_friction": (1.0, -0.8),
    "current_gain": (0.12, -0.15),
    "drift:motor_angle": (12.0, -24.0),
    "friction_fade": (0.05, 0.1),
    "friction_level": (-0.4, 0.5),
    "motor_friction": (1.0, 1.5),
    "pack_stiffness": (-0.25, 0.3),
    "spring_preload": (-0.5, 0.5),
    "supply_drop": (0.1, 0.2),
}


JAMMED = "sticking:actuator"


def run_of(
    scenario: str, seed: int, fault: str = "", size: float = 0.0, onset: float = 0.0
) -> Signals:
    """A run's signals, with a ``fault`` of that ``size`` from ``onset`` s on if one is given."""
    vehicle = load_vehicle(vehicle_of(scenario))
    outside = {"drift:motor_angle": DriftingAngle(size, onset), JAMMED: JammedMotor(onset)}
    if fault in outside:
        return clutchest.simulate(
            vehicle, scenario, seed, duration=DURATION, outsider=outside[fault]
        )
    keys = {f.name: f.key for f in vehicle.machine.faults}
    effects = {fault: {keys[fault]: size}} if fault else {}
    return clutchest.simulate(vehicle, scenario, seed, effects, duration=DURATION, onset=onset)


def tested(signals: Signals, scenario: str) -> FaultTestResults:
    """The tests of the equations over one run."""
    vehicle = load_vehicle(vehicle_of(scenario))
    blocks = blocks_at(problem_of(signals, vehicle, effects_for(vehicle.machine)))
    rate = vehicle.false_alarms_per_1000h
    return run_fault_tests(blocks, vehicle.machine, rate, DURATION / 3600.0)


def healthy(seed: int) -> dict[str, Any]:
    """What a run without a fault gives."""
    scenario = SCENARIOS[seed % len(SCENARIOS)]
    signals = run_of(scenario, seed)
    results = tested(signals, scenario)
    streams = StreamTests(load_vehicle(vehicle_of(scenario)))
    streams.take(signals, signals.end)
    z = results.residuals.z
    return {
        "seed": seed,
        "scenario": scenario,
        "failed": [r.fault.name for r in results.faults if r.status == "failed"],
        "streams": [test.name for test in streams.tests if test.alarms],
        "misfit": results.misfit_detected is not None,
        "std": dict(zip([r.fault.name for r in results.faults], z.std(axis=0), strict=True)),
        "detectable": {r.fault.name: r.detectable for r in results.faults},
        "begins": {r.fault.name: float(r.begins.max()) for r in results.faults},
        "was": {r.fault.name: float(r.was.max()) for r in results.faults},
        **blocks(results),
    }


def jammed(seed: int) -> dict[str, Any]:
    """What ``diagnose`` says of a run in which the motor jams, in any scenario."""
    scenario = SCENARIOS[seed % len(SCENARIOS)]
    onset = float(np.random.default_rng(seed).uniform(*ONSET)) if seed // 2 % 2 else 0.0
    signals = run_of(scenario, seed, JAMMED, onset=onset)
    faults = clutchest.diagnose(signals, vehicle_of(scenario)).faults
    return {
        "fault": JAMMED,
        "seed": seed,
        "scenario": scenario,
        "onset": onset,
        "faults": [f.fault for f in faults],
        "set": list(faults[0].set) if faults else [],
        "began_s": faults[0].began_s if faults else None,
        "detected_s": faults[0].first_detected_s if faults else None,
    }


def blocks(results: FaultTestResults) -> dict[str, Any]:
    """What the tests rest on, block by block."""
    residuals = results.residuals
    return {
        "end": results.blocks.end.tolist(),
        "count": residuals.count.tolist(),
        "chi_square": residuals.chi_square.tolist(),
        "z": residuals.z.tolist(),
        "information": residuals.information.tolist(),
        "level": results.noise_model.level,
        "misfits": results.misfit.tolist(),
    }


def injected(fault: str, seed: int) -> dict[str, Any]:
    """What a run with one fault gives."""
    size = CASES[fault][seed // 2 % len(CASES[fault])]
    onset = float(np.random.default_rng(seed).uniform(*ONSET)) if seed % 2 else 0.0
    declared = next(f for f in load_vehicle("alsd_rig").machine.faults if f.name == fault)
    results = tested(run_of("rig-steps", seed, fault, size, onset), "rig-steps")
    detected = [r for r in results.faults if r.detected is not None]
    names, d_prime = separability(results, np.array([r.fault.size for r in results.faults]))
    row = names.index(fault)
    scale = abs(size) / declared.size
    if onset:  # only what follows it tells
        scale *= np.sqrt(1.0 - onset / DURATION)
    rivals = [d_prime[row, k] for k, name in enumerate(names) if name != fault]
    record: dict[str, Any] = {
        "fault": fault,
        "seed": seed,
        "size": size,
        "onset": onset,
        "d_prime": float(d_prime[row, -1] * scale),
        "d_prime_nearest": float(min(rivals) * scale),
        "nearest": names[[k for k, n in enumerate(names) if n != fault][int(np.argmin(rivals))]],
        "set": [],
        "detected_s": None,
        "failed": [r.fault.name for r in results.faults if r.status == "failed"],
        **blocks(results),
    }
    if detected:
        first = min(detected, key=lambda r: r.detected or 0)
        onsets = sorted({0, *(int(r.onset[r.detected]) for r in detected)})
        ranked = explanations(results, onsets, len(results.blocks))
        best = next((e for e in ranked if e.fault == fault), None)
        record |= {
            "set": list(not_excluded(ranked)),
            "detected_s": float(results.blocks.end[first.detected]),
            "estimate": None if best is None else [best.size, best.std],
        }
    return record


def kept(path: Path, make: Any) -> dict[str, Any]:
    """The record at ``path``, made where there is none."""
    if not path.is_file():
        path.write_text(json.dumps(make(), default=float))
    return dict(json.loads(path.read_text()))


def share(k: int, n: int) -> str:
    """k of n with its 95 % interval (Clopper, Pearson)."""
    limits = binomtest(k, n).proportion_ci(0.95, "exact")
    return f"{k} of {n} [{100 * limits.low:.0f}, {100 * limits.high:.0f}] %"


def tabulated(runs: Sequence[dict[str, Any]], records: Sequence[dict[str, Any]]) -> None:
    """Print what healthy ``runs`` and ``records`` of faults show."""
    failed = Counter(name for run in runs for name in run["failed"])
    print(f"{len(runs)} healthy runs, {len(runs) * DURATION / 3600:.1f} h: {dict(failed)} failed, ")
    print(f"misfit in {sum(run['misfit'] for run in runs)}; of frames and signals:", end=" ")
    print(dict(Counter(name for run in runs for name in run["streams"])))
    for fault in CASES:
        own = [r for r in records if r["fault"] == fault]
        found = [r for r in own if r["set"]]
        right = [r for r in found if r["set"] == [fault]]
        apart = [r for r in own if r["d_prime_nearest"] >= 4.0]
        both = [r for r in apart if r["set"] == [fault]]
        std = np.median([run["std"][fault] for run in runs]) if runs else np.nan
        print(
            f"{fault:20s} std of residuals {std:.2f}; detected {len(found)}, alone {len(right)} of "
            f"{len(own)}; d' >= 4: {len(both)} of {len(apart)}",
            flush=True,
        )
    if not records:
        return
    apart = [r for r in records if r["d_prime_nearest"] >= 4.0]
    print("detected", share(sum(bool(r["set"]) for r in records), len(records)))
    print("isolated at d' >= 4", share(sum(r["set"] == [r["fault"]] for r in apart), len(apart)))
    print(
        "true fault in the set", share(sum(r["fault"] in r["set"] for r in records), len(records))
    )


def tabulated_jams(records: Sequence[dict[str, Any]]) -> None:
    """Print how runs in which the motor jams were diagnosed, by scenario."""
    for scenario in sorted({r["scenario"] for r in records}):
        own = [r for r in records if r["scenario"] == scenario]
        right = [r for r in own if r["faults"] == [JAMMED]]
        late = [r["detected_s"] - r["onset"] for r in right]
        print(
            f"{JAMMED} in {scenario}: detected, and no other fault, {len(right)} of {len(own)}"
            + (f", in the median {np.median(late):.1f} s after the onset" if late else "")
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--healthy", type=int, default=40)
    parser.add_argument("--injected", type=int, default=12, help="runs per fault")
    parser.add_argument("--jammed", type=int, default=12, help="runs in which the motor jams")
    parser.add_argument("--first", type=int, default=40000, help="first seed")
    parser.add_argument("--out", type=Path, default=Path("faults-alsd"))
    parser.add_argument(
        "--hours",
        type=float,
        default=0.0,
        help="simulated at residual level, with what healthy runs inform",
    )
    parser.add_argument("--trials", type=int, default=100, help="faults simulated per size")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    runs, records, jams = [], [], []
    for k in range(max(given.healthy, given.injected, given.jammed)):
        seed = given.first + k
        if k < given.healthy:
            runs.append(kept(given.out / f"healthy-{seed}.json", lambda s=seed: healthy(s)))
        for fault in CASES if k < given.injected else ():
            path = given.out / f"{fault.replace(':', '-')}-{seed}.json"
            records.append(kept(path, lambda f=fault, s=seed: injected(f, s)))
        if k < given.jammed:
            jams.append(kept(given.out / f"jam-{seed}.json", lambda s=seed: jammed(s)))
    tabulated(runs, records)
    tabulated_jams(jams)
    if given.hours:
        healthy_runs = [
            residuals.Record(DURATION / 3600.0, np.array(run["z"]), np.array(run["information"]))
            for run in runs
        ]
        machine = load_vehicle("alsd_rig").machine
        found = residuals.at_residual_level(machine, healthy_runs, given.hours, given.trials)
        (given.out / "residuals.json").write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
