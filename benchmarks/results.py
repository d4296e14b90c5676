"""Measures anew what stands in docs/: one command for every table.

    python benchmarks/results.py --list
    python benchmarks/results.py [--only NAME …] [--longest MINUTES] --out DIR [--write]

Each command's output is kept in DIR as NAME.txt; one that is there is not run again, so that a run
which was stopped goes on.  ``--longest`` leaves out what takes longer.  ``--write`` puts the output
of finished commands into the pages between their marks (``<!-- NAME -->`` and ``<!-- end -->``);
tables without marks, made of several outputs, are filled in by hand.
"""

from __future__ import annotations

import argparse
import shlex
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
END = "<!-- end -->"


@dataclass(frozen=True, slots=True)
class Table:
    """``command`` in the checkout, several joined by ``&&``, ``{out}`` a folder of its own;
    ``place``: page and heading; ``minutes`` on one core, about."""

    name: str
    place: str
    minutes: float
    command: str

    @property
    def page(self) -> Path:
        return ROOT / "docs" / self.place.partition("#")[0]

    @property
    def mark(self) -> str:
        return f"<!-- {self.name} -->"


TABLES = (
    Table(
        "engines",
        "performance.md#the-filter",
        1,
        "python benchmarks/engines.py --duration 30 --repeats 5",
    ),
    Table(
        "by-hand",
        "performance.md#the-filter",
        1,
        "python benchmarks/by_hand.py --duration 60 --repeats 21",
    ),
    Table(
        "by-hand-alsd",
        "performance.md#the-filter",
        1,
        "python benchmarks/by_hand.py --vehicle alsd_rig --scenario rig-steps --duration 5"
        " --repeats 11",
    ),
    Table("hour", "performance.md#an-hour", 2, "python benchmarks/log_road hour"),
    Table(
        "fleet",
        "performance.md#a-fleet",
        3,
        "python benchmarks/fleet.py --vehicles 6 --logs 3 --minutes 15 --turns 3",
    ),
    Table(
        "fleet-hours",
        "performance.md#a-fleet",
        30,
        "python benchmarks/fleet.py --vehicles 6 --logs 12 --minutes 60 --turns 2",
    ),
    Table(
        "startup",
        "performance.md#from-install-to-an-answer",
        8,
        "python benchmarks/startup.py --turns 3",
    ),
    Table("others", "performance.md#reading-logs", 10, "python benchmarks/log_road formats others"),
    Table("log-road", "performance.md#reading-logs", 30, "python benchmarks/log_road"),
    Table(
        "bound",
        "results.md#against-the-limit",
        30,
        "python benchmarks/estimator --parts own-model --duration 800 --out {out}",
    ),
    Table(
        "recovery",
        "results.md#after-a-wrong-start",
        15,
        "python benchmarks/estimator --parts recovery --drives 20 --duration 1500 --out {out}",
    ),
    Table(
        "coverage",
        "results.md#on-the-generators-drives",
        60,
        "python benchmarks/estimator --parts generator --seeds 7 --first 4000 --out {out}",
    ),
    Table("torque", "results.md#clutch-torque", 30, "python benchmarks/torque.py --seeds 20"),
    Table(
        "wear",
        "results.md#wear-over-many-drives",
        30,
        "pytest -m statistics -s tests/estimate/test_wear.py",
    ),
    Table("noise", "results.md#noise-and-delays", 60, "python benchmarks/noise.py --seeds 35"),
    Table("faults", "results.md#fault-tests", 600, "python benchmarks/faults --out {out}"),
    Table(
        "blind",
        "results.md#discovery",
        6000,
        "python benchmarks/blind --out {out} --limit 900"
        " && python benchmarks/blind --out {out} --table",
    ),
    Table("fit", "results.md#does-the-model-fit", 120, "python benchmarks/goodness_of_fit.py"),
    Table(
        "fit-power",
        "results.md#does-the-model-fit",
        60,
        "python benchmarks/goodness_of_fit.py --power",
    ),
    Table(
        "mismatch",
        "results.md#healthy-trucks-unlike-the-model",
        600,
        "python benchmarks/blind --out {out} --parts mismatch --each 4 --alone"
        " && python benchmarks/blind --out {out} --table",
    ),
    Table(
        "wander",
        "results.md#what-stating-wander-costs",
        120,
        "python benchmarks/wander.py healthy --seeds 10 --shares 0.2 1",
    ),
    Table(
        "form",
        "results.md#the-form-of-a-cause",
        300,
        "python benchmarks/form.py right --out {out}",
    ),
    Table("live", "performance.md#live", 10, "python benchmarks/live --duration 120"),
    Table(
        "killed",
        "performance.md#robustness",
        30,
        "python benchmarks/killed.py --verbs replay identify --kills 50 --seed 11",
    ),
    Table("identify", "identify.md", 20, "python benchmarks/identify.py"),
    Table("margins", "me12.md", 30, "python benchmarks/margins.py"),
    Table(
        "alsd-bound",
        "alsd-results.md#on-runs-of-its-own-model",
        60,
        "python benchmarks/estimator --vehicle alsd_rig --parts own-model recovery --duration 12"
        " --out {out}",
    ),
    Table(
        "alsd-coverage",
        "alsd-results.md#on-the-generators-runs",
        60,
        "python benchmarks/alsd.py --first 1200 --seeds 32",
    ),
    Table(
        "alsd-feedforward",
        "alsd-results.md#feedforward",
        30,
        "python benchmarks/feedforward.py",
    ),
    Table(
        "alsd-healthy",
        "alsd-results.md#discovery",
        60,
        "python benchmarks/blind --machine alsd --parts null --each 16 --out {out}",
    ),
    Table(
        "alsd-effects",
        "alsd-results.md#discovery",
        60,
        "python benchmarks/blind --machine alsd --parts effect two outsider --each 8 --out {out}",
    ),
    Table(
        "alsd-faults",
        "alsd-results.md#diagnosis",
        60,
        "python benchmarks/faults/differential.py --out {out} --healthy 24 --injected 4"
        " --first 41000",
    ),
    Table(
        "alsd-identify",
        "alsd-results.md#identification",
        300,
        "python benchmarks/identify.py --machine alsd",
    ),
)


def run(table: Table, out: Path) -> bool:
    """Keep what its command prints; whether it ended well.  Nothing is kept of one that fails."""
    unfinished = out / f"{table.name}.unfinished"
    with unfinished.open("w", encoding="utf-8") as file:
        for command in table.command.split(" && "):
            program, *arguments = shlex.split(command.format(out=out / table.name))
            module = [] if program == "python" else ["-m", program]
            done = subprocess.run([sys.executable, *module, *arguments], cwd=ROOT, stdout=file)
            if done.returncode != 0:
                print(f"{table.name}: exit code {done.returncode}", file=sys.stderr)
                return False
    unfinished.rename(out / f"{table.name}.txt")
    return True


def written(page: str, table: Table, printed: str) -> str:
    """The page with what was printed between the table's marks, where it has them."""
    before, mark, rest = page.partition(table.mark)
    if not mark:
        return page
    _, end, after = rest.partition(END)
    if not end:
        raise ValueError(f"{table.page.name}: no {END} behind {table.mark}")
    command = table.command.format(out="DIR")
    return f"{before}{mark}\n```text\n$ {command}\n{printed.rstrip()}\n```\n{end}{after}"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=Path("results-out"))
    parser.add_argument("--only", nargs="+", choices=[table.name for table in TABLES])
    parser.add_argument("--longest", type=float, default=float("inf"), metavar="MINUTES")
    parser.add_argument("--list", action="store_true", help="what there is, and what is done")
    parser.add_argument("--write", action="store_true", help="into the pages")
    given = parser.parse_args()
    out = given.out.resolve()
    chosen = [
        table
        for table in sorted(TABLES, key=lambda table: table.minutes)
        if table.name in (given.only or [t.name for t in TABLES]) and table.minutes <= given.longest
    ]
    failed = False
    for table in chosen:
        kept = out / f"{table.name}.txt"
        if given.list:
            by = "written" if table.mark in table.page.read_text(encoding="utf-8") else "by hand"
            done = "done" if kept.exists() else f"{table.minutes:g} min"
            print(f"{table.name:17} {done:>9}  {by:8} {table.place}\n{'':19}{table.command}")
            continue
        out.mkdir(parents=True, exist_ok=True)
        if not kept.exists() and not run(table, out):
            failed = True
        elif given.write:
            page = table.page.read_text(encoding="utf-8")
            printed = kept.read_text(encoding="utf-8")
            table.page.write_text(written(page, table, printed), encoding="utf-8")
    sys.exit(failed)


if __name__ == "__main__":
    main()
