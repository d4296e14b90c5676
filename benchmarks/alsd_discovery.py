"""The differential: what `discover` says of healthy specimens, and of one hidden effect each, of
two, or of a cause that stands in no library.

    python benchmarks/alsd_discovery.py size --out DIR
    python benchmarks/alsd_discovery.py null --out DIR [--first 1001] [--seeds 8] [--shard 1/2]
    python benchmarks/alsd_discovery.py effect --out DIR [--first 2001] [--seeds 1] [--shard 1/2]
    python benchmarks/alsd_discovery.py two --out DIR [--first 3001] [--seeds 12] [--shard 1/2]
    python benchmarks/alsd_discovery.py outsider --out DIR [--first 4001] [--seeds 2] [--shard 1/2]
    python benchmarks/alsd_discovery.py table --out DIR

Every seed draws a specimen and its noise.  An effect is hidden in the scenario that shows it best,
TIMES as large as one that is detected in half of the logs; which one that is, and how large, `size`
takes from scores of a healthy specimen, whose seed SIZED is used for nothing else.  Of two effects
the seed draws both, and a scenario that shows them; of an outsider its scenario and size, between
the two shares OUTSIDE of the largest possible.  Every run is one line of JSON in DIR, and is not
run again.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from collections.abc import Iterator, Mapping
from functools import partial
from itertools import combinations
from pathlib import Path
from time import process_time
from typing import Any, NamedTuple

import numpy as np
from alsd_outsiders import OUTSIDERS

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
OUTSIDE = (0.25, 0.5)
SHOWN = 3  # tests of the residuals that a record keeps
DRIVERS = 2  # of an error without a name, among which its driver is to be
Hidden = Mapping[str, Mapping[str, float]]


class Case(NamedTuple):
    """A run of a scenario with the specimen of a seed, and what is hidden in it: effects, or an
    outsider of a size."""

    scenario: str
    seed: int
    effects: Hidden
    outsider: str = ""
    size: float = 0.0


def judged(case: Case) -> dict[str, Any]:
    """What `discover` says of one run, and how it came to it."""
    vehicle = VEHICLES.get(case.scenario, "alsd_rig")
    record: dict[str, Any] = case._asdict()
    hidden = OUTSIDERS[case.outsider](case.size, case.seed % 7 / 7.0) if case.outsider else None
    signals = simulate(
        vehicle, case.scenario, case.seed, case.effects, duration=DURATION, outsider=hidden
    )
    begun = process_time()
    try:
        found = discover(signals, vehicle)
    except ClutchestError as error:
        return record | {"verdict": "error", "sentence": str(error)}
    where = found.where
    return record | {
        "verdict": found.verdict,
        "sentence": found.sentence,
        "sets": [sorted(names) for names in found.sets],
        "refuted": [c.effect for c in found.causes if c.form and c.form.refuted],
        "where": where and where.summary(),
        "others": [each.summary() for each in where.others] if where else [],
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


def nulls(first: int, seeds: int) -> Iterator[Case]:
    """Healthy specimens."""
    for seed in range(first, first + seeds):
        for scenario in SCENARIOS:
            yield Case(scenario, seed, {})


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


def hidden(out: Path, first: int, seeds: int) -> Iterator[Case]:
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
            yield Case(scenario, first + seeds * number + k, {name: {key: size}})


def two(out: Path, first: int, seeds: int) -> Iterator[Case]:
    """Specimens with two effects each."""
    sized = json.loads((out / SIZES).read_text())
    shown = {
        scenario: {
            name: {key: TIMES * size}
            for name, gains in of.items()
            for key, (size, plausible) in gains.items()
            if TIMES * size <= plausible
        }
        for scenario, of in sized.items()
    }
    for seed in range(first, first + seeds):
        rng = np.random.default_rng(seed)
        scenario = SCENARIOS[rng.integers(len(SCENARIOS))]
        pairs = list(combinations(sorted(shown[scenario]), 2))
        names = pairs[rng.integers(len(pairs))]
        yield Case(scenario, seed, {name: shown[scenario][name] for name in names})


def outsiders(first: int, seeds: int) -> Iterator[Case]:
    """Specimens with a cause that stands in no library."""
    for number, (name, outsider) in enumerate(OUTSIDERS.items()):
        for seed in range(first + seeds * number, first + seeds * (number + 1)):
            rng = np.random.default_rng(seed)
            scenario = outsider.scenarios[rng.integers(len(outsider.scenarios))]
            yield Case(scenario, seed, {}, name, float(rng.uniform(*OUTSIDE) * outsider.largest))


def table(out: Path) -> None:
    """Every run with something hidden, then healthy runs by scenario and verdict."""
    healthy, right = Counter[tuple[str, str]](), Counter[str]()
    for record in records(out):
        if not record["effects"] and not record.get("outsider"):
            healthy[record["scenario"], record["verdict"]] += 1
            continue
        what = _unnamed(record) if record.get("outsider") else _named(record)
        right[what] += 1
        print(f"{_described(record)} in {record['scenario']} ({record['seed']}): {what}")
    for (scenario, verdict), count in sorted(healthy.items()):
        print(f"healthy, {scenario}: {verdict} {count}")
    print(", ".join(f"{what} {count}" for what, count in sorted(right.items())))


def _described(record: Mapping[str, Any]) -> str:
    """What was hidden, and what was found."""
    found = " or ".join("+".join(names) for names in record.get("sets", ()))
    if name := record.get("outsider"):
        where = record.get("where") or {"equation": "", "drivers": []}
        said = f"{where['equation']} over {', '.join(where['drivers'][:DRIVERS])}"
        return f"{name} {record['size']:.3g} {OUTSIDERS[name].unit}, {found or said}"
    words = []
    for name, gains in record["effects"].items():
        ((key, size),) = gains.items()
        value, std = record.get("sizes", {}).get(f"{name}.{key}", (float("nan"),) * 2)
        words.append(f"{name} {size:.3g}, found {value:.3g} ± {std:.2g}")
    return f"{'; '.join(words)} as {found or 'nothing'}"


def _named(record: Mapping[str, Any]) -> str:
    """How effects came out."""
    effects = set(record["effects"])
    if record["verdict"] in ("none", "unknown", "error"):
        return str(record["verdict"])
    whole = [names for names in record["sets"] if set(names) == effects]
    if whole:
        return "named" if len(record["sets"]) == 1 else "in the set"
    parts = [names for names in record["sets"] if set(names) < effects]
    return "one of two" if len(parts) == len(record["sets"]) else "wrong"


def _unnamed(record: Mapping[str, Any]) -> str:
    """How a cause came out that has no name."""
    if record["verdict"] in ("none", "error"):
        return f"outsider: {record['verdict']}"
    if record["verdict"] != "unknown":
        honest = set(record["refuted"]) >= {n for names in record["sets"] for n in names}
        return "outsider: form refuted" if honest else "outsider: named"
    outsider, where = OUTSIDERS[record["outsider"]], record["where"]
    if where["equation"] not in outsider.equations:
        return "outsider: unknown, another equation"
    known = set(outsider.drivers) & set(where["drivers"][:DRIVERS])
    return "outsider: unknown, equation" + (" and driver" if known else "")


def main() -> None:
    parser = argparse.ArgumentParser(description="discovery on the differential")
    parser.add_argument("what", choices=("size", "null", "effect", "two", "outsider", "table"))
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
    drawn = {
        "null": nulls,
        "effect": partial(hidden, given.out),
        "two": partial(two, given.out),
        "outsider": outsiders,
    }
    part, parts = map(int, given.shard.split("/"))
    path = given.out / f"{given.what}-{part}.jsonl"
    done = [
        (r["scenario"], r["seed"], r["effects"], r.get("outsider", ""), r.get("size", 0.0))
        for r in records(given.out)
    ]
    for case in list(drawn[given.what](given.first, given.seeds))[part - 1 :: parts]:
        if case in done:
            continue
        record = judged(case)
        with path.open("a") as file:
            file.write(json.dumps(record) + "\n")
        print(*case, record["verdict"], record["sentence"], flush=True)


if __name__ == "__main__":
    main()
