"""Whether the intervals of `clutchest identify` hold what they say, over many machines.

    python benchmarks/identify.py [PROCEDURE …] [--machine dry_clutch|alsd] [--seeds 200] [--jobs 2]
                                  [--json FILE] [--minutes 10]

Every seed is another machine, its parameters drawn from the vehicle file's spreads, and another run
of each experiment by the independent generator; the vehicle file is what is known before.  Of the
differential `I2-10kHz` is I2 with current and voltage at 10 kHz, `I7-refit` what `--refit` gives
beside I7, `all` all logs of one specimen at
once, `chain` one after the other, each from the vehicle file that the one before it wrote.  Printed
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
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from scipy.stats import binomtest

import clutchest
from clutchest.generator.alsd.generate import draw as draw_alsd
from clutchest.generator.generate import draw
from clutchest.identify import identify_vehicle
from clutchest.identify.fit import Fitted
from clutchest.identify.likelihood import Posterior
from clutchest.identify.parameters import DETERMINED, determined, posterior_of, procedure_of
from clutchest.signals import Signals
from clutchest.vehicle import Vehicle

# Experiments: (scenario, s or None for its own duration), and the procedures fed with them.  The
# record of zero positions starts at rest, as the model supposes: `cooldown` starts hot.
RAMPS, HEATING = (("ramps", None),), (("heating", 750.0),)
LASTS = {"I1": 150.0, "I4": 150.0}  # s, instead of 600, in which the rig warms up as far
BENCHES = {
    name: ((name, LASTS.get(name)),) for name in ("I1", "I2", "I3", "I4", "I5", "I6", "I7", "I8")
}
FAST = (("I2", 6.0),)  # another duration than its own marks the log at 10 kHz
AT_200_HZ = {name: log for name, log in BENCHES.items() if name != "I2"}
SPECIMEN = (*BENCHES["I1"], *FAST, *(log for name, (log,) in BENCHES.items() if name > "I2"))
Experiments = tuple[tuple[str, float | None], ...]
LOGS: Mapping[str, Mapping[str, Experiments]] = {
    "dry_clutch": {
        "torque-curve": RAMPS,
        "expansion": HEATING,
        "thermal": HEATING,
        "disc": RAMPS,
        "all": RAMPS + HEATING,
    },
    "alsd": {
        **AT_200_HZ,
        "I2-10kHz": FAST,
        "I7-refit": BENCHES["I7"],
        "all": SPECIMEN,
        "chain": SPECIMEN,
    },
}
VEHICLES = {"dry_clutch": "truck", "alsd": "alsd_rig"}
REFIT = "refit"
SAMPLED = 1e-4  # s, by a recorder of its own
LATER = 100_000  # between the seeds of a specimen's logs
ALLOWED, POOLED, BIAS = (0.92, 0.98), (0.94, 0.97), 0.2

Found = dict[str, tuple[float, float]]  # key → error over std, std over the prior's
Task = tuple[str, tuple[str, ...], int]  # machine, procedures, seed


def one(task: Task) -> tuple[int, dict[str, Found]]:
    """(seed, procedure → what it determined)."""
    machine, names, seed = task
    vehicle = clutchest.load_vehicle(VEHICLES[machine])
    values = {key: p.value for key, p in vehicle.parameters.items()}
    spreads = {key: p.spread for key, p in vehicle.parameters.items()}
    wanted = {log for name in names for log in LOGS[machine][name]}
    if machine == "alsd":
        quick = ("armature_voltage", "armature_current")
        recorder = {name: replace(vehicle.signals[name], period=SAMPLED) for name in quick}
        fast = replace(vehicle, signals={**vehicle.signals, **recorder})
        drives = logs_of(seed, wanted, vehicle, fast)
        truth = draw_alsd(values, spreads, seed)
        return seed, {name: _on_benches(name, vehicle, drives, truth) for name in names}
    drives = {log: clutchest.simulate(vehicle, log[0], seed, duration=log[1]) for log in wanted}
    truth, _ = draw(values, spreads, seed)
    return seed, _of_a_truck(names, vehicle, drives, truth)


Drives = Mapping[tuple[str, float | None], Signals]


def logs_of(
    specimen: int,
    wanted: Collection[tuple[str, float | None]],
    vehicle: Vehicle,
    fast: Vehicle | None = None,
) -> Drives:
    """The logs ``wanted`` of one differential, each with noise of its own, those of FAST as the
    bus of ``fast`` shows them."""
    return {
        (name, lasts): clutchest.simulate(
            fast if fast and (name, lasts) in FAST else vehicle,
            name,
            LATER * (i + 1) + specimen,
            truck_seed=specimen,
            duration=lasts,
        )
        for i, (name, lasts) in enumerate(SPECIMEN)
        if (name, lasts) in wanted
    }


def _of_a_truck(
    names: Sequence[str], vehicle: Vehicle, drives: Drives, truth: Mapping[str, float]
) -> dict[str, Found]:
    posteriors: dict[str, Posterior] = {}
    found: dict[str, Found] = {}
    for name in names:
        procedure = procedure_of(name, vehicle)
        kind = procedure.sensor or name  # procedures by the readings of one sensor are one fit
        if kind not in posteriors:
            first, *later = (drives[log] for log in LOGS["dry_clutch"][name])
            signals = replace(first, later=tuple(later))
            posteriors[kind] = posterior_of(procedure, signals, vehicle)
        fits = {key: determined(posteriors[kind], key) for key in procedure.parameters}
        found[name] = _errors(fits, truth)
    return found


def _on_benches(name: str, vehicle: Vehicle, drives: Drives, truth: Mapping[str, float]) -> Found:
    logs = LOGS["alsd"][name]
    if name != "chain":
        first, *later = (drives[log] for log in logs)
        signals = replace(first, later=tuple(later))
        procedure, _, way = name.partition("-")
        fit = identify_vehicle(
            procedure, signals, vehicle, lambda text, share: None, refit=way == REFIT
        )
        return _refitted(fit.parameters, truth) if way == REFIT else _errors(fit.parameters, truth)
    found: Found = {}
    for log in logs:
        fit = identify_vehicle(log[0], drives[log], vehicle, lambda text, share: None)
        vehicle = fit.vehicle
        found |= _errors(fit.parameters, truth)
    return found


def _errors(fits: Mapping[str, Fitted], truth: Mapping[str, float]) -> Found:
    return {
        key: ((f.value - truth[key]) / f.std, f.std / f.prior_std)
        for key, f in fits.items()
        if f.determined and f.std and f.prior_std
    }


def _refitted(fits: Mapping[str, Fitted], truth: Mapping[str, float]) -> Found:
    return {
        key: ((f.refit.value - truth[key]) / f.refit.std, f.refit.std / f.prior_std)
        for key, f in fits.items()
        if f.refit and f.prior_std and f.refit.std < DETERMINED * f.prior_std
    }


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
    parser.add_argument("procedures", nargs="*", metavar="PROCEDURE", help="all unless given")
    parser.add_argument("--machine", default="dry_clutch", choices=list(LOGS))
    parser.add_argument("--seeds", type=int, default=200)
    parser.add_argument("--first", type=int, default=2000, help="first seed")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="seeds at a time")
    parser.add_argument("--minutes", type=float, default=1e6, help="begin no seed after that")
    parser.add_argument("--json", type=Path, help="kept there, and gone on from there")
    arguments = parser.parse_args()
    known = LOGS[arguments.machine]
    names = tuple(arguments.procedures or known)
    if unknown := [name for name in names if name not in known]:
        parser.error(f"{', '.join(unknown)}: expected some of {', '.join(known)}")
    runs: dict[str, dict[str, Found]] = {name: {} for name in known}
    if arguments.json and arguments.json.is_file():
        runs |= json.loads(arguments.json.read_text())
    seeds = range(arguments.first, arguments.first + arguments.seeds)
    tasks = [
        (arguments.machine, tuple(n for n in names if str(seed) not in runs[n]), seed)
        for seed in seeds
    ]
    left = [task for task in tasks if task[1]]
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
