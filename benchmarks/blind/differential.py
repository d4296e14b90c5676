"""The suite of the differential: healthy specimens, one hidden effect, two, and causes that stand
in no library.

Every seed draws a specimen and its noise.  An effect is hidden in the scenario that shows it best,
TIMES as large as one that is detected in half of the logs; which one that is, and how large, scores
of a healthy specimen say, whose seed SIZED is used for nothing else.  Of two effects the seed draws
both, and a scenario that shows them; of an outsider its scenario and size, between the two shares
OUTSIDE of the largest possible.  Every run is one line of JSON, and is not run again.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Collection, Iterator, Mapping
from itertools import combinations
from pathlib import Path
from time import process_time
from typing import Any, NamedTuple

import numpy as np
from differential_runs import DURATION, SCENARIOS, vehicle_of
from kept_records import keep, kept

from blind.differential_outsiders import OUTSIDERS
from clutchest import load_vehicle
from clutchest.discovery.discover import discover
from clutchest.discovery.search import LEVEL, begin
from clutchest.errors import ClutchestError
from clutchest.inference.fitted_gains import with_fitted_gains
from clutchest.inference.problem import Problem
from clutchest.models import machine_of
from clutchest.models.error_term_effects import error_term_effects
from clutchest.simulated import simulate

SIZED, SIZES = 902, "sizes.json"
TIMES = 2.0
OUTSIDE = (0.25, 0.5)
SHOWN = 3  # tests of the residuals that a record keeps
# Seeds: of the first case of every part, and between the first ones of two effects or outsiders
SEEDS = {"null": 10_000, "effect": 20_000, "two": 30_000, "outsider": 40_000}
APART = 500
Hidden = Mapping[str, Mapping[str, float]]
Sized = Mapping[str, Mapping[str, Mapping[str, tuple[float, float]]]]


class Case(NamedTuple):
    """A run of a scenario with the specimen of a seed, and what is hidden in it: effects, or an
    outsider of a size."""

    scenario: str
    seed: int
    effects: Hidden
    outsider: str = ""
    size: float = 0.0


def cases(parts: Collection[str], numbers: range, out: Path) -> list[Case]:
    """The cases of these ``numbers``: of every scenario without a cause, effect and outsider, and
    pairs of effects.  Sizes are those under ``out``, or are worked out and left there."""
    makers: dict[str, Callable[[range], Iterator[Case]]] = {
        "null": _nulls,
        "effect": lambda numbers: _effects(sizes(out), numbers),
        "two": lambda numbers: _two(sizes(out), numbers),
        "outsider": _outsiders,
    }
    return [case for part, made in makers.items() if part in parts for case in made(numbers)]


def run(mine: Collection[Case], out: Path, name: str, version: str) -> None:
    """Judge every case of which there is no record, each a line of the file of that ``name``."""
    done = [
        (r["scenario"], r["seed"], r["effects"], r.get("outsider", ""), r.get("size", 0.0))
        for r in records(out)
    ]
    for k, case in enumerate((case for case in mine if case not in done), 1):
        record = judged(case) | {"version": version}
        keep(out / name, record)
        print(k, *case, record["verdict"], record["sentence"], file=sys.stderr, flush=True)


def records(out: Path) -> list[dict[str, Any]]:
    """What has been run."""
    return [record for path in sorted(out.glob("*.jsonl")) for record in kept(path)]


def judged(case: Case) -> dict[str, Any]:
    """What `discover` says of one run, and how it came to it."""
    vehicle = vehicle_of(case.scenario)
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


def sizes(out: Path) -> Sized:
    """Of every scenario: effect → gain → what is detected in half of its runs, and the largest
    plausible size."""
    path = out / SIZES
    if not path.exists():
        path.write_text(json.dumps({each: _sizes(each) for each in SCENARIOS}, indent=1))
    known: Sized = json.loads(path.read_text())
    return known


def _sizes(scenario: str) -> dict[str, dict[str, list[float]]]:
    """Effect → gain → what is detected in half of the runs of this scenario, its numbers of shape
    as the effect has them by default, and the largest plausible size.  Equations are off as far as
    the vehicle file says that they may be, as in `discover`."""
    vehicle = load_vehicle(vehicle_of(scenario))
    signals = simulate(vehicle, scenario, SIZED, duration=DURATION)
    machine = machine_of("alsd")
    effects = (*machine.effects.values(), *error_term_effects(machine))
    given = signals, vehicle, effects
    problem = with_fitted_gains(Problem.of(*given, discrepant=True, input_noise=False))
    search = begin(problem)
    scores, found = search.null_scores, dict[str, dict[str, list[float]]]()
    for cause, size in zip(search.candidates, scores.threshold(LEVEL) / scores.std, strict=True):
        shapes = {number.key: number.default for number in cause.effect.parameters if number.shape}
        if size > 0.0 and dict(cause.shapes) == shapes:  # 0 where nothing excites it
            detected = float(size * problem.units[cause.index])
            found.setdefault(cause.name, {})[cause.gain.key] = [detected, cause.gain.upper]
    return found


def _nulls(numbers: range) -> Iterator[Case]:
    for number in numbers:
        for scenario in SCENARIOS:
            yield Case(scenario, SEEDS["null"] + number, {})


def _effects(sized: Sized, numbers: range) -> Iterator[Case]:
    for k, name in enumerate(sorted(machine_of("alsd").effects)):
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
        for number in numbers:
            yield Case(scenario, SEEDS["effect"] + APART * k + number, {name: {key: size}})


def _two(sized: Sized, numbers: range) -> Iterator[Case]:
    shown = {
        scenario: {
            name: {key: TIMES * size}
            for name, gains in of.items()
            for key, (size, plausible) in gains.items()
            if TIMES * size <= plausible
        }
        for scenario, of in sized.items()
    }
    for number in numbers:
        rng = np.random.default_rng(SEEDS["two"] + number)
        scenario = SCENARIOS[rng.integers(len(SCENARIOS))]
        pairs = list(combinations(sorted(shown[scenario]), 2))
        names = pairs[rng.integers(len(pairs))]
        yield Case(scenario, SEEDS["two"] + number, {name: shown[scenario][name] for name in names})


def _outsiders(numbers: range) -> Iterator[Case]:
    for k, (name, outsider) in enumerate(OUTSIDERS.items()):
        for number in numbers:
            seed = SEEDS["outsider"] + APART * k + number
            rng = np.random.default_rng(seed)
            scenario = outsider.scenarios[rng.integers(len(outsider.scenarios))]
            yield Case(scenario, seed, {}, name, float(rng.uniform(*OUTSIDE) * outsider.largest))
