"""How often `clutchest replay` doubts the signals of healthy drives.

    python benchmarks/contradictions.py [--drives N] [--first SEED] [--live] --out DIR

Simulates short drives of both machines, each with parameters and start of its own; the trucks
differ from the model, too, each in one way of the generator's.  Every drive is replayed under the
shipped file and under one of guesses, as `clutchest inspect` drafts it.  Whatever is then called a
contradiction, or a doubt, is a false alarm.  With --live the drives are not replayed: what a live
estimate finds in the begin of each is compared.  DIR keeps one file per drive, and a second run
goes on.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from differential_runs import DURATION, SCENARIOS, vehicle_of
from scipy.stats import beta

import clutchest
from clutchest.estimate.impossible import BeginOfDrive
from clutchest.generator import GROUPS, Mismatch
from clutchest.reading.drafting import guessed_parameters

TRUCK_SCENARIOS = ("city", "launches", "mixed", "pulses", "heating", "cold-start")
TRUCK_S = 120.0  # s of a drive
LEVEL = 0.95  # of the intervals
DOUBTS = {  # what a warning says → what it doubts
    "readings differ from what the model predicts": "sensors",
    "none of its": "unread",
    "does not change in": "still",
    "from where the vehicle file starts it": "state",
}


def drives_of(seed: int) -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Vehicle, scenario and options of a truck's drive and of one of the differential."""
    group = (None, *GROUPS)[seed % (len(GROUPS) + 1)]
    mismatch = Mismatch.drawn([group] if group else [], seed)
    scenario = TRUCK_SCENARIOS[seed % len(TRUCK_SCENARIOS)]
    yield "truck", scenario, {"duration": TRUCK_S, "mismatch": mismatch}
    scenario = SCENARIOS[seed % len(SCENARIOS)]
    yield vehicle_of(scenario), scenario, {"duration": DURATION}


def said(signals: clutchest.Signals, vehicle: clutchest.Vehicle) -> dict[str, str]:
    """What a replay contradicts or doubts → its words."""
    run = clutchest.replay(signals, vehicle)
    found = run.tracks[0].contradiction
    alarms = {} if found is None else {f"contradiction, {found.kind or 'any'}": found.words}
    for warning in run.summary["warnings"]:
        alarms |= {doubt: warning for words, doubt in DOUBTS.items() if words in warning}
    return alarms


def said_live(signals: clutchest.Signals, vehicle: clutchest.Vehicle) -> dict[str, str]:
    """The same of what a live estimate finds while the drive lasts."""
    begin, alarms = BeginOfDrive(vehicle), dict[str, str]()
    for start in range(0, int(signals.end), 10):
        new = signals.between(float(start), float(start + 10)).signals
        if found := begin.take(new, float(start + 10), last=start + 10 >= int(signals.end)):
            alarms[found.kind] = found.words
    return alarms


def record(seed: int, out: Path, live: bool) -> Iterator[dict[str, Any]]:
    """What was said of the drives of a ``seed``; kept, and not made again."""
    say = said_live if live else said
    for name, scenario, options in drives_of(seed):
        path = out / f"{name}-{seed}{'-live' if live else ''}.json"
        if not path.is_file():
            vehicle = clutchest.load_vehicle(name)
            signals = clutchest.simulate(vehicle, scenario, seed, **options)
            draft = replace(vehicle, parameters=guessed_parameters(vehicle.machine))
            alarms = {"shipped": say(signals, vehicle), "drafted": say(signals, draft)}
            about = {"vehicle": name, "scenario": scenario, "seed": seed}
            path.write_text(json.dumps({**about, **alarms}))
        yield json.loads(path.read_text())


def rate(alarms: int, drives: int) -> str:
    """Share of the drives with its exact interval, in %."""
    tail = (1.0 - LEVEL) / 2.0
    low = beta.ppf(tail, alarms, drives - alarms + 1) if alarms else 0.0
    high = beta.ppf(1.0 - tail, alarms + 1, drives - alarms) if alarms < drives else 1.0
    return (
        f"{alarms} of {drives}, {100 * alarms / drives:.1f} % [{100 * low:.1f}, {100 * high:.1f}]"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--drives", type=int, default=80, help="of each machine")
    parser.add_argument("--first", type=int, default=90_000, help="seed")
    parser.add_argument("--live", action="store_true")
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    records: list[dict[str, Any]] = []
    for seed in range(arguments.first, arguments.first + arguments.drives):
        records += record(seed, arguments.out, arguments.live)
    for machine, trucks in (("truck", True), ("differential", False)):
        own = [r for r in records if (r["vehicle"] == "truck") is trucks]
        for file in ("shipped", "drafted"):
            print(f"{machine}, {file} file: {rate(sum(bool(r[file]) for r in own), len(own))}")
            print(f"    {dict(Counter(name for r in own for name in r[file])) or 'nothing'}")


if __name__ == "__main__":
    main()
