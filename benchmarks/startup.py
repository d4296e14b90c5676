"""What three shortcuts at the start are worth: python benchmarks/startup.py [--turns 7]

Each is measured in processes of its own, alternating with and without:

- pandas hidden from pyarrow while a replay is written (``clutchest.record.arrow``);
- compiled readers kept on disk, dropped only where a piece of them has changed
  (``clutchest.can.text_scan``);
- the layout of a DBC kept on disk (``clutchest.can.layout_cache``).
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from statistics import median
from tempfile import TemporaryDirectory

REPLAY = """
import contextlib, sys
import clutchest.cli, clutchest.record.arrow
if {hidden} is False:
    clutchest.record.arrow.without_pandas = contextlib.nullcontext
sys.argv = ["clutchest", "replay", "demo", "--vehicle", "truck", "--out", {out!r}]
clutchest.cli.main()
"""
READ = """
from clutchest.can.files import read_frames
from clutchest.shipped import locate
read_frames(locate("demo", "logs"))
"""
LAYOUT = """
import clutchest.can.layout_cache, clutchest.can.database as database
from clutchest.shipped import locate
if {kept} is False:
    database.recalled = lambda *given: None
database.load([locate("hdt_clutch", "dbc")])
"""
CHECK = """
from time import perf_counter
from clutchest.can import text_scan
begin = perf_counter()
text_scan.drop_stale_code()
print(perf_counter() - begin)
"""


def seconds(program: str, **environment: str) -> float:
    """How long a new process takes for ``program``."""
    timed = (
        f"from time import perf_counter as clock\nbegin = clock()\ntry:\n    exec({program!r})\n"
    )
    timed += "except SystemExit:\n    pass\nprint(clock() - begin)"
    return printed(timed, **environment)


def printed(program: str, **environment: str) -> float:
    """The last number that a new process prints."""
    done = subprocess.run(
        [sys.executable, "-c", program],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=True,
    )
    return float(done.stdout.split()[-1])


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--turns", type=int, default=7)
    turns = parser.parse_args().turns
    with TemporaryDirectory() as folder:

        def replay(hidden: bool) -> float:
            return seconds(REPLAY.format(hidden=hidden, out=f"{folder}/out"))

        def read(kept: bool) -> float:
            if kept:
                return seconds(READ)
            with TemporaryDirectory() as empty:
                return seconds(READ, NUMBA_CACHE_DIR=empty)

        def layout(kept: bool) -> float:
            return seconds(LAYOUT.format(kept=kept))

        for what, run in (
            ("replay of the demo, pandas hidden", replay),
            ("reading the demo, compiled code kept", read),
            ("loading a DBC, layout kept", layout),
        ):
            run(True)  # compiles
            pairs = [(run(True), run(False)) for _ in range(turns)]
            ratios = sorted(without / with_it for with_it, without in pairs)
            first, second = (median(times) for times in zip(*pairs, strict=True))
            print(
                f"{what}: {first:.2f} s, without {second:.2f} s, × {median(ratios):.2f} "
                f"({ratios[0]:.2f} … {ratios[-1]:.2f})"
            )
    checks = [printed(CHECK) * 1e3 for _ in range(turns)]
    print(
        f"looking for stale compiled code: {median(checks):.2f} ms, at every import of the readers"
    )


if __name__ == "__main__":
    main()
