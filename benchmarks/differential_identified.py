"""Discovery under a vehicle file that `clutchest identify all` wrote for the same specimen.

    python benchmarks/differential_identified.py --out DIR [--first 50000] [--count 10]

Every seed is another specimen: a log of each of the experiments I1 to I8, from which `identify all`
makes its vehicle file, and two runs of 60 s on the rig, one scenario after the other.  The first
has nothing hidden and is judged under the shipped file and under that one; the second has an
effect, in turn, twice as large as half of such runs show under the identified file, and is judged
under that.
Finished specimens are lines of JSON in DIR and are not run again.  Printed are the findings in
healthy runs, what names hidden effects get and how far their sizes are off, and by how much the
size shrinks that half of the runs show.
"""

from __future__ import annotations

import argparse
import sys
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from differential_runs import DURATION
from kept_records import keep, kept

import clutchest
from clutchest.discovery.result import Discovery
from clutchest.identify import identify_vehicle
from clutchest.vehicle import Vehicle
from identify import LATER, SPECIMEN, logs_of, share

RIG = "alsd_rig"
SCENARIOS = "rig-steps", "rig-slow", "rig-ramps"
TIMES = 2.0  # what half of the runs show
Record = dict[str, Any]


def identified(shipped: Vehicle, specimen: int) -> Vehicle:
    """The vehicle file of a specimen, from a log of every experiment."""
    first, *later = logs_of(specimen, SPECIMEN, shipped).values()
    return identify_vehicle("all", replace(first, later=tuple(later)), shipped).vehicle


def shown(found: Discovery) -> dict[str, tuple[str, float]]:
    """Effect → its gain, and the size that half of the runs show, where that is plausible."""
    effects = clutchest.load_vehicle(RIG).machine.effects
    sizes: dict[str, tuple[str, float]] = {}
    for each in found.identifiability:
        size = each.detectable_size
        if size is not None and TIMES * size <= each.plausible_size:
            gains = effects[each.effect].gains
            sizes[each.effect] = next(g.key for g in gains if g.unit == each.unit), size
    return sizes


def one(number: int, specimen: int) -> Record:
    """All that is done with one specimen."""
    shipped = clutchest.load_vehicle(RIG)
    own, scenario = identified(shipped, specimen), SCENARIOS[number % len(SCENARIOS)]

    def run(place: int, effects: dict[str, dict[str, float]]) -> clutchest.Signals:
        seed = LATER * (20 + place) + specimen
        return clutchest.simulate(
            shipped, scenario, seed, effects, truck_seed=specimen, duration=DURATION
        )

    healthy = [clutchest.discover(run(0, {}), file) for file in (shipped, own)]
    before, after = map(shown, healthy)
    name = sorted(after)[number * len(SCENARIOS) % len(after)]
    key, size = after[name]
    found = clutchest.discover(run(1, {name: {key: TIMES * size}}), own)
    fitted = next((cause.parameters[key] for cause in found.causes if cause.effect == name), None)
    return {
        "specimen": specimen,
        "scenario": scenario,
        "healthy": [[each.verdict, *map(sorted, each.sets)] for each in healthy],
        "hidden": [name, TIMES * size],
        "verdict": found.verdict,
        "sets": [sorted(names) for names in found.sets],
        "size": fitted and [fitted.value, fitted.std],
        "shrinks": {each: after[each][1] / before[each][1] for each in after if each in before},
    }


def table(records: Sequence[Record]) -> None:
    """What the specimens tell."""
    for file, verdicts in zip(
        ("shipped", "identified"), zip(*(r["healthy"] for r in records), strict=True), strict=True
    ):
        wrong = [found for found in verdicts if found[0] != "none"]
        text = "{:.0%} [{:.1%}, {:.0%}]".format(*share([v[0] != "none" for v in verdicts]))
        print(f"findings in healthy runs, {file} file: {len(wrong)} of {len(verdicts)}, {text}")
        print(*(f"  {found}" for found in wrong), sep="\n", end="\n" if wrong else "")
    for r in records:
        name, size = r["hidden"]
        fitted = "{:.3g} ± {:.2g}".format(*r["size"]) if r["size"] else "–"
        print(f"{r['scenario']:10} {name} {size:.3g}: {r['verdict']} {r['sets']} {fitted}")
    by_effect = defaultdict(list)
    for r in records:
        for name, ratio in r["shrinks"].items():
            by_effect[name].append(ratio)
    print("what half of the runs show, identified over shipped file, median:")
    for name, ratios in sorted(by_effect.items()):
        print(f"  {name:30} {np.median(ratios):.3f} of {len(ratios)}")


def main() -> None:
    parser = argparse.ArgumentParser(description="discovery under an identified vehicle file")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--first", type=int, default=50_000, help="first specimen's seed")
    parser.add_argument("--count", type=int, default=10)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    path = options.out / "identified.jsonl"
    records = kept(path)
    done = {record["specimen"] for record in records}
    for number in range(options.count):
        if (specimen := options.first + number) not in done:
            records.append(one(number, specimen))
            keep(path, records[-1])
            print(f"{number + 1}/{options.count} {records[-1]['verdict']}", file=sys.stderr)
    table(records)


if __name__ == "__main__":
    main()
