"""The blind suite: causes hidden in simulated drives, looked for by `clutchest discover`.

    python benchmarks/blind --out blind-out [--parts null effect two outsider] [--limit 900]
                            [--least 12] [--each 4 [--after 8]] [--shard 0/2] [--measured] [--alone]
    python benchmarks/blind --out blind-out --hour
    python benchmarks/blind --out blind-out --table
    python benchmarks/blind --ci --out blind-ci [--thin 3] [--shard 0/2]
    python benchmarks/blind --ci --out blind-ci [--thin 3] --table
    python benchmarks/blind --machine alsd --out blind-alsd [--parts null effect two outsider]
                            [--each 4 [--after 8]] [--shard 0/2] [--table]

A shard takes every n-th case and resumes where it stopped: each finished case is one line of JSON
under ``--out``, and is not run again.  ``--limit`` takes a random part of the cases, the larger
one holding the smaller; ``--each`` the first so many of every cause, group or noise of the parts,
without the ``--after`` so many that were used before; ``--first`` numbers the cases from there on,
for fresh ones where all were used; ``--least`` only cases aimed at so large a d′.  ``--ci`` is the
fixed short run, whose sizes are already known; with ``--table`` it fails where a case is missing,
or where what must be reached lies outside a row's interval.  ``--thin`` takes every n-th of the
cases.
``--measured`` adds the gain on the drive held out, ``--hour`` the cost of a log of one hour;
``--alone`` holds no drive out, which could take a finding back.  The table counts the first run of
every case and says by which version; ``--again`` runs cases once more, for a second column.
``--machine alsd``: the differential's suite, see ``differential``; ``--each`` counts the cases of
every scenario without a cause, of every effect and outsider, and the pairs of effects.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Collection
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent.parent))  # started as a folder, not as a package

from kept_records import keep

from blind import differential as suite
from blind import differential_table as suite_table
from blind import table
from blind.cases import NAMED, answer
from blind.plan import PARTS, Case, drawn, each, quick
from blind.row import Row
from blind.score import hour, score
from blind.sealed import KNOWN, seal, unseal


def run(
    cases: list[Case],
    shard: str,
    out: Path,
    known: dict[str, Any],
    *,
    measured: bool,
    short: bool,
    alone: bool,
    again: bool,
) -> None:
    """Score every n-th case that has not been scored yet, all of them ``again`` if so asked.  A
    ``short`` run drives the manoeuvres that it is told to only where a line of the table is about
    them."""
    which, of = map(int, shard.split("/"))
    done: Collection[str] = () if again else table.finished(out)
    stamp = {"version": version()}
    mine = [case for case in cases[which::of] if case.name not in done]
    records = out / f"records-{which}-of-{of}.jsonl"
    for i, case in enumerate(mine, 1):
        began = time.monotonic()
        followed = not short or case.d_prime >= NAMED
        record = score(
            case,
            out,
            measured=measured,
            followed=followed,
            alone=alone,
            known=known.get(case.name),
        )
        record |= {**stamp, "at": datetime.now(UTC).isoformat(timespec="seconds")}
        keep(records, record)
        print(
            f"{i}/{len(mine)} {record['verdict']} {time.monotonic() - began:.0f} s",
            record["why"] if record["verdict"] == "failed" else "",
            file=sys.stderr,
            flush=True,
        )


def version() -> str:
    """The commit that is judged, marked where files differ from it."""
    command = ["git", "describe", "--always", "--dirty", "--exclude", "*"]
    told = subprocess.run(command, cwd=Path(__file__).parent, capture_output=True, text=True)
    return told.stdout.strip() or "not stated"


def tell(out: Path) -> list[Row]:
    """Print the table of what is finished, and write it beside the list of its cases."""
    first, again = table.runs(out)
    found = table.rows(first)
    print(table.show(first, again))
    told = {
        "versions": table.versions(first),
        "rows": [asdict(row) for row in found],
        "cases": sorted(record["name"] for record in first),
        "again": [asdict(row) for row in table.rows(again)] if again else [],
    }
    (out / "table.json").write_text(json.dumps(told, indent=1), encoding="utf-8")
    return found


def differential(parts: Collection[str], numbers: range, shard: str, out: Path) -> None:
    """Run every n-th case of the differential's suite; ``numbers``: which of every kind."""
    which, of = map(int, shard.split("/"))
    cases = suite.cases(parts, numbers, out)
    suite.run(cases[which::of], out, f"records-{which}-of-{of}.jsonl", version())


def tell_differential(out: Path) -> None:
    """Print the table of the differential's suite, and every case below it."""
    records = suite.records(out)
    print(f"first run, {table.versions(records)}", "", table.HEAD, sep="\n")
    print(*map(table.line, suite_table.rows(records)), sep="\n")
    print("", *suite_table.lines(records), sep="\n")


def prepare(cases: list[Case], shard: str, out: Path) -> None:
    """Ask the oracle for the answers of cases, once; shards leave theirs under ``out``, and
    whoever comes last puts all of them together."""
    which, of = map(int, shard.split("/"))
    mine = out / f"answers-{which}-of-{of}.sealed"
    own = unseal(mine) if mine.exists() else {}
    known = prepared(out)
    cases = [case for case in cases[which::of] if case.name not in known]
    for i, case in enumerate(cases, 1):
        own[case.name] = answer(case)
        seal(own, mine)
        print(f"{i}/{len(cases)}", file=sys.stderr, flush=True)
    seal(prepared(out), KNOWN)


def prepared(out: Path) -> dict[str, Any]:
    """The answers that are known so far, by the names of their cases."""
    files = [path for path in (KNOWN, *sorted(out.glob("answers-*.sealed"))) if path.exists()]
    return {name: answer for path in files for name, answer in unseal(path).items()}


def main() -> None:
    parser = argparse.ArgumentParser(description="causes hidden in simulated drives")
    parser.add_argument("--out", type=Path, default=Path("blind-out"))
    parser.add_argument("--machine", choices=("dry_clutch", "alsd"), default="dry_clutch")
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=PARTS)
    parser.add_argument("--limit", type=int, help="a random part of so many cases")
    parser.add_argument("--each", type=int, help="so many cases of every cause of the parts")
    parser.add_argument("--after", type=int, default=0, help="without the first so many of each")
    parser.add_argument("--first", type=int, default=0, help="number of a kind's first case")
    parser.add_argument(
        "--least", type=float, default=0.0, metavar="d′", help="only cases aimed at so much or more"
    )
    parser.add_argument("--thin", metavar="n", type=int, default=1, help="every n-th case only")
    parser.add_argument("--shard", default="0/1", metavar="i/n")
    parser.add_argument("--ci", action="store_true", help="the fixed short run")
    parser.add_argument("--measured", action="store_true", help="gain on the drive held out")
    parser.add_argument("--alone", action="store_true", help="no drive is held out")
    parser.add_argument("--hour", action="store_true", help="only the cost of a log of one hour")
    parser.add_argument("--table", action="store_true", help="the table of what is finished")
    parser.add_argument("--again", action="store_true", help="cases run before are run again")
    parser.add_argument("--prepare", action="store_true", help="only the sizes to hide")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    if given.machine == "alsd":
        if not given.table:
            numbers = range(given.after, given.after + (given.each or 1))
            differential(given.parts, numbers, given.shard, given.out)
        return tell_differential(given.out)
    if given.ci:
        cases = quick()
    elif given.each:
        cases = each(given.parts, given.each, given.after, given.first)
    else:
        cases = drawn(given.parts, given.limit, given.first)
    cases = [case for case in cases if case.d_prime >= given.least][:: given.thin]
    if given.prepare:
        return prepare(cases, given.shard, given.out)
    if given.hour:
        with (given.out / "records-hour.jsonl").open("w") as records:
            for name, effects in table.HOURS.items():
                records.write(json.dumps(hour(given.out, name, effects)) + "\n")
    elif not given.table:
        run(
            cases,
            given.shard,
            given.out,
            prepared(given.out),
            measured=given.measured,
            short=given.ci,
            alone=given.alone,
            again=given.again,
        )
    found = tell(given.out)
    if given.ci and given.table:
        missing = {case.name for case in cases} - set(table.finished(given.out))
        refuted = [row.what for row in found if row.refuted]
        if missing or refuted:
            parser.exit(1, f"{len(missing)} cases missing; refuted: {', '.join(refuted)}\n")


if __name__ == "__main__":
    main()
