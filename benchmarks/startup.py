"""What shortcuts at the start are worth: python benchmarks/startup.py [--turns 5] [--only REPLAY]

Processor seconds of processes of their own, alternating with and without:

- functions compiled by ``clutchest.native`` instead of numba, nothing compiled before: the first
  replay and the first diagnosis on a machine;
- compiled code kept on disk;
- the layout of a DBC kept on disk (``clutchest.can.layout_cache``);
- pandas hidden from pyarrow while a replay is written (``clutchest.record.arrow``).

Then, in an empty cache, what one replay after another costs whose model has another structure.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from turns import in_turns, with_byte_code

from clutchest.shipped import locate

VERB = """
import contextlib, sys
import clutchest.cli, clutchest.record.arrow
if {hidden} is False:
    clutchest.record.arrow.without_pandas = contextlib.nullcontext
sys.argv = ["clutchest", {verb!r}, "demo", "--vehicle", "truck", "--out", {out!r}]
clutchest.cli.main()
"""
LAYOUT = """
import clutchest.can.layout_cache, clutchest.can.database as database
from clutchest.shipped import locate
if {kept} is False:
    database.recalled = lambda *given: None
database.load([locate("hdt_clutch", "dbc")])
"""


def seconds(program: str, **environment: str) -> float:
    """Processor time of a new process that runs ``program``."""
    before = os.times()
    done = subprocess.run(
        [sys.executable, "-c", program],
        env=with_byte_code() | environment,
        capture_output=True,
        text=True,
    )
    after = os.times()
    if done.returncode not in (0, 1):  # 1: a diagnosis with a fault
        raise RuntimeError(done.stderr)
    return sum(after[2:4]) - sum(before[2:4])


def fresh(program: str, **environment: str) -> float:
    """The same where nothing has been compiled or kept before."""
    with TemporaryDirectory() as empty:
        return seconds(program, CLUTCHEST_CACHE=empty, NUMBA_CACHE_DIR=empty, **environment)


def structures(folder: str, turns: int) -> str:
    """A line: processor seconds of one replay after another, nothing having been compiled."""
    truck, rig, extended = "truck", "alsd_rig", f"{folder}/extended.toml"
    effects = "friction_fade = { slope = 0.001 }\nwear = { rate = 0.02 }"
    shipped = locate(truck, "vehicles").read_text(encoding="utf-8")
    Path(extended).write_text(f"{shipped}\n[effects]\n{effects}\n", encoding="utf-8")
    log, simulate = f"{folder}/rig.parquet", ["simulate", "--vehicle", rig, "--scenario"]
    simulate += ["rig-steps", "--duration", "30", "-o", log]
    subprocess.run([sys.executable, "-m", "clutchest", *simulate], check=True, capture_output=True)
    runs = [
        ("the first", "demo", truck),
        ("with effects", "demo", extended),
        ("again", "demo", extended),
        ("of the differential", log, rig),
        ("again", log, rig),
    ]
    costs: list[list[float]] = [[] for _ in runs]
    for _ in range(turns):
        with TemporaryDirectory() as empty:
            for cost, (_, source, vehicle) in zip(costs, runs, strict=True):
                arguments = ["replay", source, "--vehicle", vehicle, "--out", f"{folder}/out"]
                program = f"import sys, clutchest.cli as c; sys.argv[1:] = {arguments}; c.main()"
                cost.append(seconds(program, CLUTCHEST_CACHE=empty))
    return "replays by structure: " + ", ".join(
        f"{name} {median(cost):.2f} s" for cost, (name, *_) in zip(costs, runs, strict=True)
    )


def comparisons(folder: str) -> dict[str, Callable[[bool], float]]:
    """What is compared: a run with (True) or without (False) the shortcut."""

    def verb(name: str, hidden: bool = True) -> str:
        return VERB.format(verb=name, hidden=hidden, out=f"{folder}/{name}")

    def compiler(ours: bool) -> str:
        return "native" if ours else "numba"

    return {
        "first replay, native instead of numba": lambda ours: fresh(
            verb("replay"), CLUTCHEST_COMPILER=compiler(ours)
        ),
        "first diagnosis, native instead of numba": lambda ours: fresh(
            verb("diagnose"), CLUTCHEST_COMPILER=compiler(ours)
        ),
        "replay, what was compiled and read kept": lambda kept: (
            seconds(verb("replay")) if kept else fresh(verb("replay"))
        ),
        "loading a DBC, layout kept": lambda kept: seconds(LAYOUT.format(kept=kept)),
        "replay, pandas hidden": lambda hidden: seconds(verb("replay", hidden)),
    }


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--turns", type=int, default=5)
    parser.add_argument("--only", default="", help="comparisons whose name contains this")
    given = parser.parse_args()
    with TemporaryDirectory() as folder:
        for what, run in comparisons(folder).items():
            if given.only not in what:
                continue
            run(True)  # compiles, reads
            ways = {"without": partial(run, False), "with": partial(run, True)}
            print(in_turns(what, ways, given.turns, " s"), flush=True)
        if given.only in "replays by structure":
            print(structures(folder, given.turns))


if __name__ == "__main__":
    main()
