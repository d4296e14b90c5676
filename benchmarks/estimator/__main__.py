"""How good the estimator is: against the Cramér–Rao bound on drives from its own model, on the
generator's drives, in clutch torque, and after a wrong start.

    python benchmarks/estimator --out estimator-out

prints the tables, writes them to ``estimator.json`` and draws ``accuracy.png`` and
``recovery.png``.  With the defaults it takes about half an hour on two cores.
"""

from __future__ import annotations

import argparse
import json
import sys
from multiprocessing import cpu_count
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))  # what benchmarks share is a file beside
sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))  # drives from the filter's own model

import generator_drives
import own_model
import pictures
import recovery
from clutches import CLUTCHES
from parallel import ran

from clutchest import load_vehicle

PARTS = ("own-model", "generator", "recovery")


def main() -> None:
    parser = argparse.ArgumentParser(description="how good the estimator is")
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=PARTS)
    parser.add_argument("--plans", type=int, default=12, help="schedules of engagements")
    parser.add_argument("--drives", type=int, default=50, help="drives drawn of each schedule")
    parser.add_argument("--duration", type=float, default=900.0, help="s of each schedule")
    parser.add_argument("--seeds", type=int, default=20, help="drives of the generator a scenario")
    parser.add_argument("--scenarios", nargs="+", help="of the generator")
    parser.add_argument("--first", type=int, default=2000, help="first seed")
    parser.add_argument("--vehicle", default="truck")
    parser.add_argument("--jobs", type=int, default=cpu_count())
    parser.add_argument("--out", type=Path, default=Path("estimator-out"))
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    found: dict[str, Any] = {"arguments": {k: str(v) for k, v in vars(given).items()}}
    clutch = CLUTCHES[load_vehicle(given.vehicle).model]
    scenarios = given.scenarios or clutch.scenarios
    seeds = range(given.first, given.first + given.plans)

    if "own-model" in given.parts:
        tasks = [(given.vehicle, seed, given.drives, given.duration) for seed in seeds]
        results = ran("own model", own_model.drives, tasks, given.jobs)
        found["own_model"] = own_model.table(results)
        print(own_model.show(found["own_model"]) + "\n", flush=True)
    if "recovery" in given.parts:
        few = max(given.drives // 5, 1)
        tasks = [(given.vehicle, seed, few, given.duration) for seed in seeds]
        results = ran("recovery", recovery.starts, tasks, given.jobs)
        found["recovery"] = recovery.table(results)
        print(recovery.show(found["recovery"]) + "\n", flush=True)
        pictures.recovery(results, clutch.wrong, given.out / "recovery.png")
    if "generator" in given.parts:
        tasks = [
            (given.vehicle, case, scenario, given.first + 100 * number + k)
            for case in generator_drives.CASES
            for number, scenario in enumerate(scenarios)
            for k in range(given.seeds)
        ]
        results = ran("generator", generator_drives.drive, tasks, given.jobs)
        found["generator"] = generator_drives.table(results)
        print(generator_drives.show(found["generator"]), flush=True)
    pictures.accuracy(found, given.out / "accuracy.png")
    (given.out / "estimator.json").write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
