"""How often is the form of a cause refuted: of one that is right, and of one that only resembles?

    python benchmarks/form.py right --out DIR [--count 80] [--skip 0]
    python benchmarks/form.py near --out DIR [--count 16] [--skip 0]

Drives of five minutes by other trucks in the blind suite's scenarios and noises.  ``right``: gains
of the library in turn, of sizes from a tenth of the largest plausible one to all of it; where a
cause improves the fit by 2 Δ ln L of 40 or more it is taken for named, and its form is tested.
``near``: the suite's near misses in turn, a quarter or half as large as the class may be, as
``discover`` answers without a drive held out; an equation is said to be as likely where an error
may be in it instead, or a cause of a tied set is; a driver where it is tied with the first.  A
second table is of those that the suite's oracle can tell from effects of the library.  Finished
cases are lines of JSON in DIR and are not run again.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from kept_records import keep, kept
from scipy.optimize import minimize_scalar
from scipy.stats import binomtest

sys.path.insert(0, str(Path(__file__).parent))

from blind.drives import NOISES, Drive
from blind.near_misses import NEAR_MISSES
from blind.oracle import Oracle
from blind.outsiders import Outsider
from blind.plan import gains
from blind.seen import Seen

from clutchest.discovery.cause_set import CauseSet, cost_of
from clutchest.discovery.discover import discover
from clutchest.discovery.form_test import tested_forms
from clutchest.discovery.result import Discovery
from clutchest.discovery.search import Search, begin, with_noise_of_best
from clutchest.discovery.segmentation import segmented
from clutchest.discovery.shape_profile import refine
from clutchest.inference.problem import Problem
from clutchest.models.error_term_effects import error_term_effects
from clutchest.signals import Signals

LEAST = 0.1  # of the largest plausible size
NAMED = 40.0  # 2 Δ ln L
RIGHT, NEAR = 310_000, 320_000  # seeds from here on
TOLD = 8.0  # distance, squared, of what can be told from every effect of the library
EVALUATED = 8  # shapes, at most, for the nearest
SHARES = 0.25, 0.5  # of the largest size of a near miss
Record = dict[str, Any]


class Short(Drive):
    """A drive of five minutes."""

    duration = 300.0


def problem_of(signals: Signals, drive: Drive) -> Problem:
    """As ``discover`` makes it."""
    vehicle = drive.vehicle
    effects = (*vehicle.machine.effects.values(), *error_term_effects(vehicle.machine))
    return Problem.of(segmented(signals, vehicle), vehicle, effects, discrepant=True)


def fitted(problem: Problem, gain: str) -> tuple[Search, CauseSet]:
    """A search in which the one cause is named that has this ``effect.gain``."""
    search = begin(problem)
    causes = [c for c in search.candidates if c.gain_name == gain]
    grown = [search.likeliest((c,), [search.null.fit]) for c in causes]
    search, grown = with_noise_of_best(search, grown)
    best, *rivals = sorted(grown, key=cost_of)
    search = replace(search, best=best, rivals=tuple(rivals), by_count={1: tuple(grown)})
    search, _ = refine(search)
    return search, search.released(search.best)


def right(name: str) -> Record:
    """The form of an effect that is what it seems to be."""
    _, gain, case = name.split("-")
    seed = RIGHT + int(case)
    random = np.random.default_rng([seed, 2])
    drive = Short(seed, str(random.choice(list(NOISES))))
    effect, key = gain.split(".")
    numbers = drive.vehicle.machine.effects[effect].parameters
    hides = {n.key: float(random.uniform(min(n.grid), max(n.grid))) for n in numbers if n.shape}
    number = next(n for n in numbers if n.key == key)
    size = number.upper * LEAST ** float(random.uniform())
    hides[key] = size if number.one_sided or random.uniform() < 0.5 else max(-size, number.lower)
    search, best = fitted(problem_of(drive.signals({effect: hides}), drive), gain)
    explained = search.null.cost - best.cost
    told = {"scenario": drive.scenario, "noise": drive.noise, "explained": explained}
    if explained < NAMED:
        return {**told, "named": False}
    ((_, tested),) = tested_forms(search, best).items()
    form = tested.form
    covariate = form.curve.covariate if form.curve else None
    return {
        **told,
        "named": True,
        "form": form.state,
        "p_value": form.p_value,
        "covariate": covariate,
    }


def near(name: str) -> Record:
    """What is said of a near miss."""
    _, cause, case = name.split("-")
    seed = NEAR + int(case)
    random = np.random.default_rng([seed, 2])
    drive, kind = Short(seed, str(random.choice(list(NOISES)))), NEAR_MISSES[cause]
    outsider = kind(float(random.choice(SHARES)) * kind.largest, float(random.uniform()))
    found = discover(drive.signals(outsider=outsider), drive.vehicle)
    where = found.where
    likely = (where, *where.instead) if where else ()
    return {
        "scenario": drive.scenario,
        "noise": drive.noise,
        "size": outsider.size / kind.largest,
        "distance": None if found.verdict == "none" else distance(drive, outsider, found),
        "verdict": found.verdict,
        "causes": [c.effect for c in found.causes],
        "forms": [c.form.state for c in found.causes],
        "p_values": [c.form.p_value for c in found.causes],
        "equation": where and where.equation,
        "drivers": where and where.covariates[:4],
        "errors": where.errors if where else [],
        "tied": [name for each in likely for name in each.likeliest],
        "instead": [*(each.equation for each in likely[1:]), *equations_tied(found)],
        "expected": [kind.equations(), kind.drivers],
    }


def equations_tied(found: Discovery) -> list[str]:
    """The equations of causes that are as likely as the first set's."""
    first = found.sets[0] if found.sets else ()
    return list(dict.fromkeys(c.equation for c in found.causes if c.effect not in first))


def distance(drive: Drive, outsider: Outsider, found: Discovery) -> float:
    """By how many standard deviations the oracle parts a near miss from the effect of the library
    that comes nearest, or from what it was taken for where that is nearer."""
    oracle = Oracle(drive)
    twin = oracle.twin(outsider=outsider)
    from_effects = min(oracle.nearest(twin, whole=False).values())
    return min([from_effects, *(_from(oracle, twin, found, causes) for causes in found.sets)])


def _from(oracle: Oracle, twin: Seen, found: Discovery, causes: Sequence[str]) -> float:
    """From ``causes``, in the shapes that come nearest, each of them in turn."""
    numbers = {(e, n.key): n for e in causes for n in oracle.effects[e].parameters if n.shape}
    shapes = {(e, key): found.by_name[e].parameters[key].value for e, key in numbers}
    nearest = oracle.distance(twin, causes, shapes)
    for at, number in numbers.items():

        def off(value: float, at: tuple[str, str] = at) -> float:
            return oracle.distance(twin, causes, {**shapes, at: value})

        within = np.clip(np.array([0.6, 1.6]) * shapes[at], number.lower, number.upper)
        best = minimize_scalar(off, bounds=within, method="bounded", options={"maxiter": EVALUATED})
        if best.fun < nearest:
            nearest, shapes[at] = float(best.fun), float(best.x)
    return nearest


def names(which: str, count: int) -> list[str]:
    """Every case, causes in turn."""
    causes = gains() if which == "right" else sorted(NEAR_MISSES)
    return [f"{which}-{causes[i % len(causes)]}-{i}" for i in range(count)]


def tell(which: str, records: Sequence[Record]) -> None:
    """Rates with their exact 95 % intervals."""
    if which == "right":
        records = [r for r in records if r["named"]]
        rates = {
            "form not tested": [r["form"] is None for r in records],
            "form refuted": [r["form"] == "refuted" for r in records],
        }
    else:
        records = [r for r in records if r["verdict"] != "none"]
        rates = _rates_of_near(records)
        told = [r for r in records if r["distance"] ** 2 >= TOLD]
        rates |= {f"of those told, {what}": hits for what, hits in _rates_of_near(told).items()}
    for what, hits in rates.items():
        limits = binomtest(sum(hits), len(hits)).proportion_ci(0.95, "exact")
        print(f"{what:40}{sum(hits):4} of {len(hits)}  [{limits.low:.3f}, {limits.high:.3f}]")


def _rates_of_near(records: Sequence[Record]) -> dict[str, list[bool]]:
    """Of near misses in which something is found, by what is asked."""
    return {
        "unknown, or form refuted": [
            r["verdict"] == "unknown" or "refuted" in r["forms"] for r in records
        ],
        "equation": [r["equation"] in r["expected"][0] for r in records],
        "equation, or said to be as likely": [
            bool({r["equation"], *r["instead"]} & set(r["expected"][0])) for r in records
        ],
        "driver in the first two": [
            bool(set(r["expected"][1]) & set((r["drivers"] or [])[:2])) for r in records
        ],
        "driver, or said to be as likely": [
            bool(set(r["expected"][1]) & {*(r["drivers"] or [])[:2], *r["tied"]}) for r in records
        ],
    }


def main() -> None:
    parser = argparse.ArgumentParser(description="how often the form of a cause is refuted")
    parser.add_argument("which", choices=("right", "near"))
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--count", type=int, default=80)
    parser.add_argument("--skip", type=int, default=0)
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    path = given.out / f"{given.which}.jsonl"
    done = {record["name"]: record for record in kept(path)}
    test = right if given.which == "right" else near
    for name in names(given.which, given.skip + given.count)[given.skip :]:
        if name in done:
            continue
        began = time.process_time()
        done[name] = {"name": name, **test(name)}
        done[name]["seconds"] = round(time.process_time() - began, 1)
        keep(path, done[name])
        print(name, done[name]["seconds"], file=sys.stderr, flush=True)
    tell(given.which, list(done.values()))


if __name__ == "__main__":
    main()
