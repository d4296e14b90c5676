"""This version against another: python benchmarks/paired.py OTHER/src [--turns 5] [--only hour]
[--wall]

Processor seconds, of processes of their own, that alternate between the two, with ``--wall`` those
from begin to end, which only a quiet machine tells; a ratio is formed within each turn.  Byte code,
compiled code and layouts are there from a run before the first turn, each version's in a folder of
its own.  The kernel is timed per event of a city drive.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage
from tempfile import TemporaryDirectory
from time import perf_counter

from turns import in_turns, with_byte_code

CLUTCHEST = "import sys; from clutchest.cli import main; sys.argv[0] = 'clutchest'; main()"
ENGINES = """
import runpy, sys, time
time.perf_counter = time.process_time
import clutchest
truck = clutchest.load_vehicle("truck")
drive = clutchest.read_log("minute.log", truck)
result = runpy.run_path(sys.argv[1] + "/../benchmarks/engines.py")["compare"](drive, truck, 5)
print(min(result["us_per_event"][sys.argv[2]]))
"""
FILTERS = ("online (filterpy)", "kernel", "kernel with signatures")
MADE = {"hour.log": 3600, "quarter.log": 900, "minute.log": 60}  # s of driving in the city


def commands() -> dict[str, tuple[str, list[str]]]:
    """A program with its arguments, by what it does; one that prints a number is worth that."""
    truck, rig = (["--vehicle", name, "--out", "out"] for name in ("truck", "alsd_rig"))
    return {
        "import": ("import clutchest", []),
        "--help": (CLUTCHEST, ["--help"]),
        **{f"{name}, µs an event": (ENGINES, [name]) for name in FILTERS},
        "replay of the demo": (CLUTCHEST, ["replay", "demo", *truck]),
        "replay of an hour": (CLUTCHEST, ["replay", "hour.log", *truck]),
        "replay of an hour in Parquet": (CLUTCHEST, ["replay", "hour.parquet", *truck]),
        "replay of 30 s of the differential": (CLUTCHEST, ["replay", "rig.parquet", *rig]),
        "diagnosis of 15 minutes": (CLUTCHEST, ["diagnose", "quarter.log", *truck]),
    }


def spent() -> float:
    """Processor seconds of the processes that have ended."""
    usage = getrusage(RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def cost(
    clock: Callable[[], float], program: str, arguments: list[str], source: Path, folder: Path
) -> float:
    """Seconds by the ``clock`` that a new process takes, or the number that it prints."""
    environment = with_byte_code() | {
        "PYTHONPATH": str(source),
        "PYTHONPYCACHEPREFIX": str(folder / "bytes"),
    }
    environment |= {"CLUTCHEST_CACHE": str(folder / "cache"), "NUMBA_CACHE_DIR": str(folder)}
    before = clock()
    done = subprocess.run(
        [sys.executable, "-c", program, *([str(source)] if program is ENGINES else []), *arguments],
        env=environment,
        cwd=folder.parent,
        capture_output=True,
        text=True,
    )
    after = clock()
    if "Traceback" in done.stderr:
        raise RuntimeError(done.stderr)
    return float(done.stdout) if program is ENGINES else after - before


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("other", type=Path, help="the folder src of the other version")
    parser.add_argument("--turns", type=int, default=5)
    parser.add_argument("--only", default="", help="rows whose name contains this")
    parser.add_argument("--wall", action="store_true", help="seconds from begin to end")
    given = parser.parse_args()
    clock = perf_counter if given.wall else spent
    own = Path(__file__).resolve().parent.parent / "src"
    with TemporaryDirectory() as place:
        sides = [(own, Path(place) / "own"), (given.other.resolve(), Path(place) / "other")]
        for _, folder in sides:
            folder.mkdir()
        for log, seconds in MADE.items():
            make = ["simulate", "--vehicle", "truck", "--scenario", "city", "--seed", "5"]
            cost(clock, CLUTCHEST, [*make, "--duration", str(seconds), "-o", log], *sides[0])
        table = ["convert", "hour.log", "-o", "hour.parquet", "--vehicle", "truck"]
        cost(clock, CLUTCHEST, table, *sides[0])
        rig = ["simulate", "--vehicle", "alsd_rig", "--scenario", "rig-steps", "--seed", "5"]
        cost(clock, CLUTCHEST, [*rig, "--duration", "30", "-o", "rig.parquet"], *sides[0])
        for what, (program, arguments) in commands().items():
            if given.only not in what:
                continue
            ways = {
                name: partial(cost, clock, program, arguments, *side)
                for name, side in zip(("this", "the other"), sides, strict=True)
            }
            for once in ways.values():
                once()
            unit = "" if program is ENGINES else " s"
            print(in_turns(what, ways, given.turns, unit), flush=True)


if __name__ == "__main__":
    main()
