"""Whether the intervals of `clutchest identify` hold what they say, over many trucks.

    python benchmarks/identify.py [--procedures torque-curve disc …] [--seeds 200] [--jobs 2]
                                  [--json FILE] [--minutes 10]

Every seed is another truck, its parameters drawn from the vehicle file's spreads, and another drive
of each experiment by the independent generator; the vehicle file is what is known before.  Printed
are, per parameter that was determined in a seed: how often the truth lay within two standard
deviations, with the 95 % interval of that share (Clopper, Pearson); the mean error in standard
deviations; and how much of the prior's standard deviation is left in the median.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from scipy.stats import binomtest

import clutchest
from clutchest.generator.generate import draw
from clutchest.identify.likelihood import Posterior
from clutchest.identify.parameters import determined, posterior_of, procedure_of

# Experiments: (scenario, s or None for its own duration), and the procedures fed with them.  The
# record of zero positions starts at rest, as the model supposes: `cooldown` starts hot.
RAMPS, HEATING = (("ramps", None),), (("heating", 750.0),)
LOGS: Mapping[str, tuple[tuple[str, float | None], ...]] = {
    "torque-curve": RAMPS,
    "expansion": HEATING,
    "thermal": HEATING,
    "disc": RAMPS,
    "all": RAMPS + HEATING,
}
ALLOWED, POOLED, BIAS = (0.92, 0.98), (0.94, 0.97), 0.2

Found = dict[str, tuple[float, float]]  # key → error over std, std over the prior's


def one(task: tuple[tuple[str, ...], int]) -> tuple[int, dict[str, Found]]:
    """(seed, procedure → what it determined)."""
    names, seed = task
    vehicle = clutchest.load_vehicle("truck")
    values = {key: p.value for key, p in vehicle.parameters.items()}
    truth, _ = draw(values, {key: p.spread for key, p in vehicle.parameters.items()}, seed)
    drives = {
        log: clutchest.simulate(vehicle, log[0], seed, duration=log[1])
        for log in {log for name in names for log in LOGS[name]}
    }
    posteriors: dict[str, Posterior] = {}
    found: dict[str, Found] = {}
    for name in names:
        procedure = procedure_of(name, vehicle)
        kind = procedure.sensor or name  # procedures by the readings of one sensor are one fit
        if kind not in posteriors:
            first, *later = (drives[log] for log in LOGS[name])
            signals = replace(first, later=tuple(later))
            posteriors[kind] = posterior_of(procedure, signals, vehicle)
        found[name] = {}
        for key in procedure.parameters:
            fitted = determined(posteriors[kind], key)
            if fitted.determined:
                error = (fitted.value - truth[key]) / fitted.std
                found[name][key] = (error, fitted.std / fitted.prior_std)
    return seed, found


def share(inside: Sequence[bool]) -> tuple[float, float, float]:
    """Share and its 95 % interval."""
    test = binomtest(int(np.sum(inside)), len(inside))
    ends = test.proportion_ci(0.95, method="exact")
    return test.statistic, float(ends.low), float(ends.high)


def judged(of_key: Sequence[tuple[float, float]]) -> dict[str, object]:
    """Coverage, bias and what is left of the prior, over the seeds that determined a parameter."""
    errors, left = np.array(of_key).T
    return {
        "determined": len(errors),
        "coverage": share(list(np.abs(errors) <= 2.0)),
        "bias": float(errors.mean()),
        "bias_std": float(errors.std(ddof=1) / np.sqrt(len(errors))) if len(errors) > 1 else 0.0,
        "left": float(np.median(left)),
    }


def table(runs: Mapping[str, Mapping[str, Found]]) -> None:
    """``runs``: procedure → seed → what it determined."""
    print(f"{'':14}{'':30}{'determined':>12}{'within 2σ':>24}{'bias, σ':>16}{'left':>7}")
    for name, of in runs.items():
        by_key: dict[str, list[tuple[float, float]]] = defaultdict(list)
        for found in of.values():
            for key, pair in found.items():
                by_key[key].append(pair)
                by_key["pooled"].append(pair)
        by_key["pooled"] = by_key.pop("pooled", [])
        for key, pairs in by_key.items():
            if not pairs:
                continue
            row = judged(pairs)
            inside = "{:.1%} [{:.1%}, {:.1%}]".format(*row["coverage"])
            low, high = POOLED if key == "pooled" else ALLOWED
            _, least, most = row["coverage"]
            off = "" if least <= high and most >= low and abs(row["bias"]) < BIAS else "  *"
            bias = f"{row['bias']:+.2f} ± {row['bias_std']:.2f}"
            print(
                f"{name:14}{key:30}{row['determined']:>7}/{len(of):<4}{inside:>24}"
                f"{bias:>16}{row['left']:>7.2f}{off}"
            )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--procedures", nargs="+", default=list(LOGS), choices=list(LOGS))
    parser.add_argument("--seeds", type=int, default=200)
    parser.add_argument("--first", type=int, default=2000, help="first seed")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="seeds at a time")
    parser.add_argument("--minutes", type=float, default=1e6, help="begin no seed after that")
    parser.add_argument("--json", type=Path, help="kept there, and gone on from there")
    arguments = parser.parse_args()
    runs: dict[str, dict[str, Found]] = {name: {} for name in LOGS}
    if arguments.json and arguments.json.is_file():
        runs |= json.loads(arguments.json.read_text())
    names = tuple(arguments.procedures)
    seeds = range(arguments.first, arguments.first + arguments.seeds)
    left = [(tuple(n for n in names if str(seed) not in runs[n]), seed) for seed in seeds]
    left = [task for task in left if task[0]]
    end = time.monotonic() + 60.0 * arguments.minutes
    with get_context("spawn").Pool(arguments.jobs) as pool:
        for count, (seed, found) in enumerate(pool.imap_unordered(one, left), 1):
            for name, of_seed in found.items():
                runs[name][str(seed)] = of_seed
            print(f"{count}/{len(left)}", end="\r", file=sys.stderr)
            if arguments.json:
                arguments.json.write_text(json.dumps(runs))
            if time.monotonic() > end:
                break
    table({name: runs[name] for name in names})


if __name__ == "__main__":
    main()
