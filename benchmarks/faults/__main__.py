"""Fault tests: false alarms in healthy drives, detection delays beside an oracle, isolation.

    python benchmarks/faults --out faults-out

records every drive, continues where it was stopped, and counts all records in the folder
(``--drives 0`` only counts); prints tables, writes them to ``faults.json`` and draws
``delays.png``.  An hour of driving takes about twenty-five seconds.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterable
from multiprocessing import cpu_count
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent.parent))  # what benchmarks share is a file beside

import healthy
import injected
import pictures
import recorded
import residuals
import unlike
from parallel import ran

import clutchest

PARTS = ("healthy", "hot", "unlike", "residuals", "injected", "recorded")


def main() -> None:
    parser = argparse.ArgumentParser(description="fault tests: false alarms, delays, isolation")
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=PARTS)
    parser.add_argument(
        "--drives", type=int, default=1000, help="healthy drives, half an hour each"
    )
    parser.add_argument(
        "--hot", type=int, default=20, help="drives per heat condition and scenario"
    )
    parser.add_argument("--unlike", type=int, default=4, help="drives of trucks unlike the model")
    parser.add_argument("--injected", type=int, default=10, help="drives per fault")
    parser.add_argument("--hours", type=float, default=20_000.0, help="simulated at residual level")
    parser.add_argument("--trials", type=int, default=400, help="faults simulated per size")
    parser.add_argument(
        "--logs", type=Path, help="folder of the recorded drives and their DBCs; none without"
    )
    parser.add_argument("--onsets", type=int, default=5, help="recorded drives per fault")
    parser.add_argument("--first", type=int, default=2000, help="first seed")
    parser.add_argument("--vehicle", default="truck")
    parser.add_argument("--jobs", type=int, default=cpu_count())
    parser.add_argument("--out", type=Path, default=Path("faults-out"))
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    path = given.out / "faults.json"
    results: dict[str, Any] = json.loads(path.read_text()) if path.is_file() else {}
    folder = given.out / "drives"
    folder.mkdir(exist_ok=True)

    if "healthy" in given.parts:
        tasks = [
            (given.vehicle, healthy.SCENARIOS[i % 3], given.first + i, "within its spreads", folder)
            for i in range(given.drives)
        ]
        ran("healthy", healthy.record, tasks, given.jobs)
        results["healthy"] = healthy.tally(folder)
        print(json.dumps(results["healthy"], indent=1))
    if "hot" in given.parts:
        hot = given.out / "hot"
        hot.mkdir(exist_ok=True)
        tasks = [
            (given.vehicle, scenario, given.first + i, heat, hot)
            for i in range(given.hot)
            for heat in healthy.HEAT
            for scenario in healthy.scenarios(heat)
        ]
        ran("hot", healthy.record, tasks, given.jobs)
        results["hot"] = healthy.tally(hot)
        print(json.dumps(results["hot"], indent=1))
    if "unlike" in given.parts:
        found = of_each("unlike", unlike.record, unlike.GROUPS, given.unlike, given)
        results["unlike"] = unlike.table(found)
        print(json.dumps(results["unlike"], indent=1))
    if "residuals" in given.parts:
        machine = clutchest.load_vehicle(given.vehicle).machine
        records = residuals.loaded(folder)
        results["residuals"] = residuals.at_residual_level(
            machine, records, given.hours, given.trials
        )
        pictures.delays(results["residuals"], given.out / "delays.png")
    if "injected" in given.parts:
        found = of_each("injected", injected.judged, injected.CASES, given.injected, given)
        results["injected"] = injected.table(found)
        print(json.dumps(results["injected"], indent=1))
    if "recorded" in given.parts and given.logs is not None:
        results["recorded"] = recorded.table(given.logs, given.onsets)
    path.write_text(json.dumps(results, indent=1))


def of_each(
    part: str,
    judge: Callable[[tuple[str, str, int, Path]], dict[str, Any]],
    names: Iterable[str],
    count: int,
    given: argparse.Namespace,
) -> list[dict[str, Any]]:
    """What is said of so many drives of each name, kept in a folder of the part's own."""
    folder = given.out / part
    folder.mkdir(exist_ok=True)
    numbers = range(given.first, given.first + count)
    tasks = [(given.vehicle, name, number, folder) for number in numbers for name in names]
    return ran(part, judge, tasks, given.jobs)


if __name__ == "__main__":
    main()
