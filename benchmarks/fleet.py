"""Two workers against one: python benchmarks/fleet.py [--vehicles 8] [--logs 3] [--minutes 20]

`clutchest fleet` over logs of several vehicles, by one worker and by two in turn, each into an
empty folder and with one processor a worker, where the system can say which: a replay alone uses
more than one.  Efficiency: time from begin to end by one worker, over twice that by two; the start
of the cluster and the comparison of the vehicles are in both.  That of processor time, of all
processes, does not count waiting, and holds where other programs share the cores.  Memory: peak of
the largest process.  ``--folder`` has the logs already, or keeps them.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter

import clutchest
from clutchest.simulated import write_simulation

CLUTCHEST = "import sys; from clutchest.cli import main; sys.argv[0] = 'clutchest'; main()"


def logs(folder: Path, vehicles: int, each: int, minutes: float) -> None:
    """Drives in the city, ``each`` of every truck."""
    truck = clutchest.load_vehicle("truck")
    for k in range(vehicles):
        (folder / f"truck-{k}").mkdir(parents=True)
        for drive in range(each):
            path, seed = folder / f"truck-{k}" / f"{drive}.log", each * k + drive
            write_simulation(path, truck, "city", seed, duration=60.0 * minutes, truck_seed=k)


def restrict(processors: int) -> None:
    """Have this process and those that it starts use so many processors."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:processors])


def run(folder: Path, out: Path, workers: int) -> tuple[float, float]:
    """Seconds from begin to end, and processor seconds, of the command."""
    arguments = ["fleet", folder, "--vehicle", "truck", "--out", out, "--workers", str(workers)]
    program = [sys.executable, "-c", CLUTCHEST, *map(str, arguments)]
    before, begin = getrusage(RUSAGE_CHILDREN), perf_counter()
    subprocess.run(
        program, check=True, capture_output=True, text=True, preexec_fn=partial(restrict, workers)
    )
    took, after = perf_counter() - begin, getrusage(RUSAGE_CHILDREN)
    processor = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return took, processor


def told(what: str, values: Sequence[float]) -> str:
    ordered = sorted(values)
    return f"{what}: {median(ordered):.2f} ({ordered[0]:.2f} … {ordered[-1]:.2f})"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--vehicles", type=int, default=8)
    parser.add_argument("--logs", type=int, default=3)
    parser.add_argument("--minutes", type=float, default=20.0)
    parser.add_argument("--turns", type=int, default=3)
    parser.add_argument("--folder", type=Path, help="of the logs")
    given = parser.parse_args()
    with TemporaryDirectory() as place:
        folder = given.folder or Path(place) / "logs"
        if not folder.exists():
            logs(folder, given.vehicles, given.logs, given.minutes)
        run(folder, Path(place) / "compiled", 2)
        turns = [
            [run(folder, Path(place) / f"{turn}-{workers}", workers) for workers in (1, 2)]
            for turn in range(given.turns)
        ]
    print(f"{given.vehicles} vehicles, {given.logs} logs of {given.minutes:g} min each")
    print(told("one worker, s", [one[0] for one, _ in turns]))
    print(told("two workers, s", [two[0] for _, two in turns]))
    print(told("efficiency", [one[0] / (2 * two[0]) for one, two in turns]))
    print(told("efficiency of processor time", [one[1] / two[1] for one, two in turns]))
    print(f"largest process: {getrusage(RUSAGE_CHILDREN).ru_maxrss / 1024:.0f} MiB")


if __name__ == "__main__":
    main()
