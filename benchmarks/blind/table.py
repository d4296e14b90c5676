"""The table that the suite is judged by, from records of scored cases."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from kept_records import kept

from blind.filtered import filtered
from blind.first_run import first_run
from blind.row import Record, Row, share

NOT_STATED = "not stated"
HEAD = f"{'what':56}{'must':>20}{'cases':>7}{'value':>9}  {'interval':25}"
HOURS: Mapping[str, Mapping[str, Mapping[str, float]]] = {  # logs of one hour, and what they hide
    "hour": {},
    "hour with a cause": {"friction_fade": {"slope": 0.02, "onset": 120.0}},
}


def runs(out: Path) -> tuple[list[Record], list[Record]]:
    """The first run of every case that any shard has finished, and the last of those that were run
    again."""
    first: dict[str, Record] = {}
    last: dict[str, Record] = {}
    for record in sorted(_records(out), key=lambda record: record.get("at", "")):
        name = record["name"]
        (last if name in first else first)[name] = record
    return list(first.values()), list(last.values())


def finished(out: Path) -> dict[str, Record]:
    """Name → first record of every case that any shard has finished."""
    return {record["name"]: record for record in runs(out)[0]}


def _records(out: Path) -> Iterator[dict[str, Any]]:
    for path in sorted(out.glob("records-*.jsonl")):
        yield from kept(path)


def rows(records: Sequence[Record]) -> list[Row]:
    """Every line of the table: the main ones, what it costs, and the filtered ones."""
    return [*first_run(records), *cost(records), *filtered(records)]


def versions(records: Sequence[Record]) -> str:
    """Which versions gave these records, in one line."""
    counts: dict[str, int] = {}
    for record in records:
        version = record.get("version", NOT_STATED)
        counts[version] = counts.get(version, 0) + 1
    told = ", ".join(f"{version} ({count})" for version, count in sorted(counts.items()))
    one = len(counts) == 1 and NOT_STATED not in counts
    return f"{'one version' if one else 'not of one version'}: {told or 'no cases'}"


def cost(records: Sequence[Record]) -> list[Row]:
    of_hours = {r["name"]: r for r in records if r["part"] == "hour" and r["verdict"] != "failed"}
    found = []
    for name in HOURS:
        for what, key, most in (("s of one core", "seconds", 30.0), ("MiB", "MiB", 1024.0)):
            hides = bool(HOURS[name])  # how long that takes depends on what there is to fit
            row = Row(f"a log of one {name}: {what}", "" if hides else f"≤ {most:.0f}")
            if name in of_hours:
                value = of_hours[name][key]
                passed = None if hides else value <= most
                row = Row(row.what, row.must, 1, value, passed=passed)
            found.append(row)
    return [*found, *_each(records)] if records else found


def _each(records: Sequence[Record]) -> list[Row]:
    seconds = [r["seconds"] for r in records]
    failed = [r["verdict"] == "failed" for r in records]
    return [
        Row(
            "processor time of one discovery, s",
            "",
            len(records),
            float(np.median(seconds)),
            float(np.min(seconds)),
            float(np.max(seconds)),
        ),
        Row(
            "memory of one discovery, MiB, largest",
            "",
            len(records),
            float(np.max([r["MiB"] for r in records])),
        ),
        replace(
            share("discoveries that failed", "none", failed, lambda p: p == 0.0),
            refuted=any(failed),
        ),
    ]


def show(first: Sequence[Record], again: Sequence[Record]) -> str:
    """The table as text; what repeated cases gave is a column of its own."""
    repeated = {row.what: row for row in rows(again)}
    main = len([*first_run(first), *cost(first)])
    lines = [f"first run, {versions(first)}"]
    lines += [f"again, {versions(again)}"] if again else []
    head = HEAD + "again" * bool(again)
    for i, row in enumerate(rows(first)):
        if i in (0, main):
            lines += ["", "all cases" if i == 0 else "of these, by what the drive can show", head]
        lines.append(line(row, repeated.get(row.what)))
    return "\n".join(lines)


def line(row: Row, again: Row | None = None) -> str:
    """One of its lines as text."""
    beside = f"{again.value:.3g} ({again.count})" if again and again.value is not None else ""
    begin = f"{row.what:56}{row.must:>20}{row.count:7d}"
    if row.value is None:
        return f"{begin}        –  {'':25}{beside}".rstrip()
    between = "" if row.low is None else f"[{row.low:.3g}, {row.high:.3g}]"
    mark = {True: "pass", False: "FAIL", None: ""}[row.passed if row.must else None]
    return f"{begin}{row.value:9.3g}  {between:20}{mark:5}{beside}".rstrip()
