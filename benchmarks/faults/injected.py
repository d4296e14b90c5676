"""Faults injected into whole drives by the generator: detection, isolation and size estimates."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import clutchest
from clutchest.inference.score_test import NOT_EXCLUDED

DURATION = 1800.0
# fault → (effect, key, sizes, scenario)
CASES = {
    "torque_bias": ("torque_bias", "bias", (40.0, -80.0), "city"),
    "torque_gain": ("torque_gain", "change", (0.12, -0.15), "city"),
    "friction_level": ("friction_level", "change", (-0.2, 0.25), "launches"),
    "friction_fade": ("friction_fade", "slope", (0.1, 0.25), "heating"),
    "position_offset": ("position_offset", "offset", (-1.2, 1.2), "city"),
    "wear": ("wear", "amount", (3.5, 4.0), "launches"),
}
TRUE_SETS = {"wear": {"wear", "position_offset"}, "position_offset": {"position_offset", "wear"}}


def judged(task: tuple[str, str, int, Path]) -> dict[str, Any]:
    """Test one drive with one fault and record the result; an existing record is kept."""
    vehicle, fault, seed, out = task
    path = out / f"{fault}-{seed}.json"
    if path.is_file():
        return dict(json.loads(path.read_text()))
    effect, key, sizes, scenario = CASES[fault]
    size = sizes[seed % len(sizes)]
    truck = clutchest.load_vehicle(vehicle)
    signals = clutchest.simulate(truck, scenario, seed, {effect: {key: size}}, duration=DURATION)
    diagnosis = clutchest.diagnose(clutchest.replay(signals, truck))
    isolability = diagnosis.isolability
    d_prime = nearest = None
    if isolability is not None and fault in isolability.faults:
        row = isolability.faults.index(fault)
        scale = abs(size) / isolability.sizes[row]
        d_prime = float(isolability.d_prime[row, -1] * scale)
        others = [
            isolability.d_prime[row, k]
            for k, f in enumerate(isolability.faults)
            if f != fault and f not in TRUE_SETS.get(fault, set())
        ]
        nearest = float(min(others) * scale)
    record = {
        "fault": fault,
        "seed": seed,
        "size": size,
        "d_prime": d_prime,
        "d_prime_nearest": nearest,
        "faults": [f.fault for f in diagnosis.faults],
        "sets": [list(f.set) for f in diagnosis.faults],
        "detected_s": diagnosis.faults[0].first_detected_s if diagnosis.faults else None,
        "causes": [
            {"fault": c.fault, "size": c.size, "std": c.std, "behind": c.behind}
            for f in diagnosis.faults
            for c in f.causes
        ],
    }
    path.write_text(json.dumps(record))
    return record


def table(records: list[dict[str, Any]]) -> dict[str, Any]:
    """Per fault: how many were detected, how many of them isolated, errors of the sizes."""
    rows: dict[str, Any] = {}
    for fault in CASES:
        own = [r for r in records if r["fault"] == fault]
        detected = [r for r in own if r["faults"]]
        right = [r for r in detected if _right(r)]
        separable = [r for r in own if (r["d_prime_nearest"] or 0.0) >= 4.0]
        separable_right = [r for r in separable if r["faults"] and _right(r)]
        pulls = [
            (c["size"] - r["size"]) / c["std"]
            for r in detected
            for c in r["causes"][:3]
            if c["fault"] == fault and c["behind"] < NOT_EXCLUDED
        ]
        rows[fault] = {
            "drives": len(own),
            "detected": len(detected),
            "right": len(right),
            "separable": len(separable),
            "of_these_right": len(separable_right),
            "mean_pull": sum(pulls) / len(pulls) if pulls else None,
            "wrong": [(r["seed"], r["size"], r["sets"]) for r in detected if not _right(r)],
        }
    return rows


def _right(record: dict[str, Any]) -> bool:
    """Whether one fault was reported: it, or the set that no signal distinguishes from it."""
    wanted = TRUE_SETS.get(record["fault"], {record["fault"]})
    return (
        len(record["sets"]) == 1
        and record["fault"] in record["sets"][0]
        and set(record["sets"][0]) <= wanted
    )
