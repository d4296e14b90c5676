"""The active differential: what `discover` says of healthy runs, and of one hidden effect each.

    python benchmarks/alsd_discovery.py --out DIR [--scenarios rig-steps …] [--first 911]
                                        [--seeds 4] [--effect NAME:KEY=VALUE] [--duration 60]
    python benchmarks/alsd_discovery.py --out DIR --table

Every run is one line of JSON in DIR, and is not run again.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from time import process_time
from typing import Any

from clutchest.discovery.discover import discover
from clutchest.simulated import simulate

VEHICLES = {"car": "alsd_car"}
SCENARIOS = ("rig-steps", "rig-slow", "rig-ramps", "car")
RECORDS = "records.jsonl"


def judged(
    scenario: str, seed: int, effects: dict[str, dict[str, float]], duration: float
) -> dict[str, Any]:
    """What `discover` says of one run, and how it came to it."""
    vehicle = VEHICLES.get(scenario, "alsd_rig")
    signals = simulate(vehicle, scenario, seed, effects, duration=duration)
    begun = process_time()
    found = discover(signals, vehicle)
    return {
        "scenario": scenario,
        "seed": seed,
        "effects": effects,
        "verdict": found.verdict,
        "sentence": found.sentence,
        "sets": [sorted(names) for names in found.sets],
        "sizes": {
            f"{cause.effect}.{key}": [size.value, size.std]
            for cause in found.causes
            for key, size in cause.parameters.items()
        },
        "fit": found.fit.p_value,
        "tests": [test.words for test in found.fit.tests[:3]],
        "detectable": {each.effect: each.detectable_size for each in found.identifiability},
        "seconds": process_time() - begun,
    }


def records(out: Path) -> Iterator[dict[str, Any]]:
    """What has been run."""
    path = out / RECORDS
    lines = path.read_text().splitlines() if path.exists() else []
    return map(json.loads, lines)


def table(out: Path) -> None:
    """Healthy runs by scenario and verdict, then every run with an effect."""
    healthy = Counter[tuple[str, str]]()
    for record in records(out):
        if record["effects"]:
            sets = " or ".join("+".join(names) for names in record["sets"])
            print(record["scenario"], record["effects"], record["verdict"], sets, record["sizes"])
        else:
            healthy[record["scenario"], record["verdict"]] += 1
    for (scenario, verdict), count in sorted(healthy.items()):
        print(f"{scenario}: {verdict} {count} times")


def main() -> None:
    parser = argparse.ArgumentParser(description="discovery on the differential")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--scenarios", nargs="+", default=SCENARIOS)
    parser.add_argument("--first", type=int, default=911)
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--duration", type=float, default=60.0)
    parser.add_argument("--effect", help="NAME:KEY=VALUE to hide")
    parser.add_argument("--table", action="store_true", help="only the table of what was run")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    if given.table:
        table(given.out)
        return
    hidden: dict[str, dict[str, float]] = {}
    if given.effect:
        name, number = given.effect.split(":")
        key, value = number.split("=")
        hidden = {name: {key: float(value)}}
    done = [(r["scenario"], r["seed"], r["effects"]) for r in records(given.out)]
    for seed in range(given.first, given.first + given.seeds):
        for scenario in given.scenarios:
            if (scenario, seed, hidden) in done:
                continue
            record = judged(scenario, seed, hidden, given.duration)
            with (given.out / RECORDS).open("a") as file:
                file.write(json.dumps(record) + "\n")
            print(scenario, seed, record["verdict"], record["sentence"], flush=True)


if __name__ == "__main__":
    main()
