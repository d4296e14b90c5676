"""Slow wander in healthy drives, and what its allowance costs in the detection of slow causes.

    python benchmarks/wander.py healthy [--first 52000] [--seeds 12] [--shares 0 0.2 1]
    python benchmarks/wander.py power [--first 53000] [--seeds 6] [--shares 0 1]

Friction and torque bias wander by a share of what ``benchmarks/torque.py`` calls normal; every seed
is another truck, with parameters drawn from the vehicle file's spreads, on 20 minutes of one of the
blind suite's scenarios, in turn.  ``healthy`` counts the verdicts of ``discover``.  ``power``: the
smallest detectable size of slow causes by score test, over that where the density of the wander is
known exactly (first column) and over that without wander (second); medians over drives, in which
the cause is absent; and how often ``discover`` gives a verdict other than ``none``, and the right
name among its causes, where a cause has 8 standard deviations with the density known.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

import clutchest
from clutchest.discovery.candidate_scores import columns
from clutchest.discovery.search import Search, begin, free_of
from clutchest.inference.problem import Problem
from clutchest.inference.score_test import score_test
from clutchest.models.error_term_effects import error_term_effects
from clutchest.signals import Floats
from clutchest.vehicle import Estimation

SCENARIOS = ("city", "launches", "mixed", "pulses", "heating", "slip-steps")
FRICTION, TORQUE_BIAS = 5e-4, 0.5  # 1/√s, Nm/√s
DURATION = 1200.0  # s
SLOW = ("wear", "rate"), ("friction_fade", "slope"), ("friction_temperature", "slope")
AIM = 8.0  # standard deviations


def wandering() -> clutchest.Vehicle:
    """The truck, of which the file states that friction and torque bias wander."""
    truck = clutchest.load_vehicle("truck")
    densities = {"friction": FRICTION, "torque_bias": TORQUE_BIAS}
    states = {s.name: s for s in truck.machine.equations(set(truck.signals)).states}
    stated = {
        name: Estimation(s.role, s.process_noise, s.initial_std, s.useful_std, densities[name])
        for name, s in states.items()
        if name in densities
    }
    return replace(truck, estimation=stated)


def drive(share: float, seed: int, effects: Mapping[str, Mapping[str, float]]) -> clutchest.Signals:
    """What the bus shows of a truck whose friction and torque bias wander."""
    disturbances = {
        "friction_std": 0.02,
        "torque_bias_std": 5.0,
        "friction_walk": share * FRICTION,
        "torque_bias_walk": share * TORQUE_BIAS,
    }
    scenario = SCENARIOS[seed % len(SCENARIOS)]
    return clutchest.simulate(
        "truck",
        scenario,
        seed,
        effects,
        truck_seed=seed,
        disturbances=disturbances,
        duration=DURATION,
    )


def healthy(share: float, seeds: range) -> None:
    """Print the verdicts on drives in which nothing is wrong."""
    verdicts: Counter[str] = Counter()
    for seed in seeds:
        verdicts[clutchest.discover(drive(share, seed, {}), wandering()).verdict] += 1
        done = sum(verdicts.values())
        print(f"wander {share:g}: {verdicts['none']} of {done} none, {dict(verdicts)}", flush=True)


def stds(search: Search, share: float | None) -> Floats:
    """Standard deviation of every candidate's size, in units of its largest plausible one; with
    this share of the stated wander, that shown by the log unless given."""
    objective = search.objective
    fit = objective.linearise_at(search.null.fit.theta)
    objective = objective.with_discrepancies(
        fit, None if share is None else np.full(len(search.problem.discrepancies), share)
    )
    fit = objective.whitened(fit)
    scores = score_test(
        fit,
        free_of(search.problem, ()),
        objective.prior,
        columns(objective, fit, search.candidates),
        [c.gain.one_sided for c in search.candidates],
        1,
        2,
    )
    return 1.0 / scores.std


def power(share: float, seeds: range) -> None:
    """Print what the allowance costs in the size of slow causes that is detected."""
    vehicle = wandering()
    machine = vehicle.machine
    effects = (*machine.effects.values(), *error_term_effects(machine))
    ratios: dict[str, list[tuple[float, float]]] = {name: [] for name, _ in SLOW}
    found: dict[str, list[tuple[bool, bool]]] = {name: [] for name, _ in SLOW}
    for seed in seeds:
        search = begin(Problem.of(drive(share, seed, {}), vehicle, effects, discrepant=True))
        shown, known, without = stds(search, None), stds(search, share), stds(search, 0.0)
        for name, key in SLOW:
            own = [
                i
                for i, c in enumerate(search.candidates)
                if (c.name, c.gain.key) == (name, key) and known[i] > 0.0
            ]
            if not own:
                continue
            i = min(own, key=lambda i: known[i])
            cause = search.candidates[i]
            size = AIM * known[i] * cause.gain.upper
            if size > cause.gain.upper:
                continue
            ratios[name].append((shown[i] / known[i], shown[i] / without[i]))
            shapes = dict(cause.shapes)
            answer = clutchest.discover(drive(share, seed, {name: {key: size, **shapes}}), vehicle)
            found[name].append(
                (answer.verdict != "none", name in [c.effect for c in answer.causes])
            )
    for name, pairs in ratios.items():
        if pairs:
            known_ratio, without_ratio = np.median(pairs, axis=0)
            detected, named = np.sum(found[name], axis=0)
            print(
                f"wander {share:g}, {name}: {known_ratio:.2f} {without_ratio:.2f}; detected "
                f"{detected}, right cause in the answer {named}, of {len(pairs)}",
                flush=True,
            )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("healthy", "power"))
    parser.add_argument("--first", type=int, default=52000)
    parser.add_argument("--seeds", type=int, default=12)
    parser.add_argument("--shares", type=float, nargs="+", default=[0.0, 0.2, 1.0])
    arguments = parser.parse_args()
    seeds = range(arguments.first, arguments.first + arguments.seeds)
    for share in arguments.shares:
        (healthy if arguments.what == "healthy" else power)(share, seeds)


if __name__ == "__main__":
    main()
