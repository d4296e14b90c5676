"""The differential: what `discover` says of healthy specimens, and of one hidden effect each.

    python benchmarks/alsd_discovery.py size --out DIR
    python benchmarks/alsd_discovery.py null --out DIR [--first 1001] [--seeds 8] [--shard 1/2]
    python benchmarks/alsd_discovery.py effect --out DIR [--first 2001] [--seeds 1] [--shard 1/2]
    python benchmarks/alsd_discovery.py table --out DIR

Every seed draws a specimen and its noise.  An effect is hidden in the scenario that shows it
best, TIMES as large as one that is detected in half of the logs; which one that is, and how large,
`size` takes from scores of a healthy specimen, whose seed SIZED is used for nothing else.  Every
run is one line of JSON in DIR, and is not run again.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from time import process_time
from typing import Any

from clutchest import load_vehicle
from clutchest.discovery.discover import discover
from clutchest.discovery.search import LEVEL, begin
from clutchest.errors import ClutchestError
from clutchest.inference.fitted_gains import with_fitted_gains
from clutchest.inference.problem import Problem
from clutchest.models import machine_of
from clutchest.simulated import simulate

VEHICLES = {"car": "alsd_car"}
SCENARIOS = ("rig-steps", "rig-slow", "rig-ramps", "car", "slip-oil-sweep", "coast")
DURATION = 60.0  # s
SIZED, SIZES = 902, "sizes.json"
TIMES = 2.0
SHOWN = 3  # tests of the residuals that a record keeps
Hidden = Mapping[str, Mapping[str, float]]


def judged(scenario: str, seed: int, effects: Hidden) -> dict[str, Any]:
    """What `discover` says of one run, and how it came to it."""
    vehicle = VEHICLES.get(scenario, "alsd_rig")
    record: dict[str, Any] = {"scenario": scenario, "seed": seed, "effects": effects}
    signals = simulate(vehicle, scenario, seed, effects, duration=DURATION)
    begun = process_time()
    try:
        found = discover(signals, vehicle)
    except ClutchestError as error:
        return record | {"verdict": "error", "sentence": str(error)}
    return record | {
        "verdict": found.verdict,
        "sentence": found.sentence,
        "sets": [sorted(names) for names in found.sets],
        "sizes": {
            f"{cause.effect}.{key}": [size.value, size.std]
            for cause in found.causes
            for key, size in cause.parameters.items()
        },
        "fit": found.fit.p_value,
        "tests": [test.words for test in found.fit.tests[:SHOWN]],
        "seconds": process_time() - begun,
    }


def records(out: Path) -> list[dict[str, Any]]:
    """What has been run."""
    lines = [line for path in sorted(out.glob("*.jsonl")) for line in path.read_text().splitlines()]
    return [json.loads(line) for line in lines]


def nulls(first: int, seeds: int) -> Iterator[tuple[str, int, Hidden]]:
    """Healthy specimens."""
    for seed in range(first, first + seeds):
        for scenario in SCENARIOS:
            yield scenario, seed, {}


def sizes(scenario: str) -> dict[str, dict[str, list[float]]]:
    """Effect → gain → what is detected in half of the runs of this scenario, its numbers of shape
    as the effect has them by default, and the largest plausible size."""
    vehicle = load_vehicle(VEHICLES.get(scenario, "alsd_rig"))
    signals = simulate(vehicle, scenario, SIZED, duration=DURATION)
    effects = machine_of("alsd").effects
    problem = with_fitted_gains(
        Problem.of(signals, vehicle, tuple(effects.values()), discrepant=True)
    )
    search = begin(problem)
    scores, found = search.null_scores, dict[str, dict[str, list[float]]]()
    for cause, size in zip(search.candidates, scores.threshold(LEVEL) / scores.std, strict=True):
        shapes = {number.key: number.default for number in cause.effect.parameters if number.shape}
        if size > 0.0 and dict(cause.shapes) == shapes:  # 0 where nothing excites it
            detected = float(size * problem.units[cause.index])
            found.setdefault(cause.name, {})[cause.gain.key] = [detected, cause.gain.upper]
    return found


def hidden(out: Path, first: int, seeds: int) -> Iterator[tuple[str, int, Hidden]]:
    """Specimens with one effect each, where it shows best."""
    sized = json.loads((out / SIZES).read_text())
    for number, name in enumerate(sorted(machine_of("alsd").effects)):
        shares = {
            (scenario, key): size / plausible
            for scenario, of in sized.items()
            for key, (size, plausible) in of.get(name, {}).items()
            if TIMES * size <= plausible
        }
        if not shares:
            print(f"{name}: no scenario shows it at a plausible size", file=sys.stderr)
            continue
        scenario, key = min(shares, key=lambda each: shares[each])
        size = TIMES * sized[scenario][name][key][0]
        for k in range(seeds):
            yield scenario, first + seeds * number + k, {name: {key: size}}


def table(out: Path) -> None:
    """Healthy runs by scenario and verdict, then every run with an effect."""
    healthy, right = Counter[tuple[str, str]](), Counter[str]()
    for record in records(out):
        if not record["effects"]:
            healthy[record["scenario"], record["verdict"]] += 1
            continue
        (name,) = record["effects"]
        ((key, size),) = record["effects"][name].items()
        sets = " or ".join("+".join(names) for names in record.get("sets", ()))
        value, std = record.get("sizes", {}).get(f"{name}.{key}", (float("nan"),) * 2)
        right[_judged(name, record)] += 1
        print(
            f"{name} {size:.3g} in {record['scenario']} ({record['seed']}): {record['verdict']} "
            f"{sets} {value:.3g} ± {std:.2g}: {_judged(name, record)}"
        )
    for (scenario, verdict), count in sorted(healthy.items()):
        print(f"healthy, {scenario}: {verdict} {count}")
    print(", ".join(f"{what} {count}" for what, count in sorted(right.items())))


def _judged(name: str, record: Mapping[str, Any]) -> str:
    if record["verdict"] in ("none", "unknown", "error"):
        return str(record["verdict"])
    own = [names for names in record["sets"] if name in names]
    if not own:
        return "wrong"
    return "named" if len(record["sets"]) == 1 and len(own[0]) == 1 else "in the set"


def main() -> None:
    parser = argparse.ArgumentParser(description="discovery on the differential")
    parser.add_argument("what", choices=("size", "null", "effect", "table"))
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--first", type=int, default=1001)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--shard", default="1/1", metavar="i/n")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    if given.what == "table":
        table(given.out)
        return
    if given.what == "size":
        found = {scenario: sizes(scenario) for scenario in SCENARIOS}
        (given.out / SIZES).write_text(json.dumps(found, indent=1))
        return
    cases = nulls if given.what == "null" else lambda *drawn: hidden(given.out, *drawn)
    part, parts = map(int, given.shard.split("/"))
    path = given.out / f"{given.what}-{part}.jsonl"
    done = [(r["scenario"], r["seed"], r["effects"]) for r in records(given.out)]
    for case in list(cases(given.first, given.seeds))[part - 1 :: parts]:
        if case in done:
            continue
        record = judged(*case)
        with path.open("a") as file:
            file.write(json.dumps(record) + "\n")
        print(*case, record["verdict"], record["sentence"], flush=True)


if __name__ == "__main__":
    main()
