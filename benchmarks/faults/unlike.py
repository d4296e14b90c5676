"""Healthy trucks that differ from the model as ordinary ones do, one way each: nothing may fail."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any

import clutchest
from clutchest.generator.mismatch import GROUPS, Mismatch

Task = tuple[str, str, int, Path]  # vehicle, group of the generator's, number, folder
DURATION = 900.0  # s
SCENARIOS = ("city", "mixed", "launches", "pulses")


def record(task: Task) -> dict[str, Any]:
    """What failed in one drive; kept, and not tested again."""
    vehicle, group, number, folder = task
    path = folder / f"{group}-{number}.json"
    if not path.is_file():
        place = list(GROUPS).index(group)
        scenario, seed = SCENARIOS[(number + place) % len(SCENARIOS)], 1000 * number + place
        unlike = Mismatch.drawn([group], seed)
        truck = clutchest.load_vehicle(vehicle)
        drive = clutchest.simulate(truck, scenario, seed, duration=DURATION, mismatch=unlike)
        failed = [m.name for m in clutchest.diagnose(drive, truck).monitors if m.status == "failed"]
        path.write_text(json.dumps({"group": group, "scenario": scenario, "failed": failed}))
    return dict(json.loads(path.read_text()))


def table(records: list[dict[str, Any]]) -> dict[str, Any]:
    """By group: drives, hours, drives in which something failed, and what."""
    rows = {}
    for group in GROUPS:
        own = [r["failed"] for r in records if r["group"] == group]
        rows[group] = {
            "drives": len(own),
            "hours": len(own) * DURATION / 3600.0,
            "failed": sum(map(bool, own)),
            "monitors": dict(Counter(name for failed in own for name in failed)),
        }
    return rows
