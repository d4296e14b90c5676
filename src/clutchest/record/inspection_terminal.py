"""The inspection of a log or of a table in a terminal."""

from __future__ import annotations

from collections.abc import Sequence

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.table import Column, Table

from clutchest.reading.inspection import Inspection
from clutchest.reading.table_inspection import TableInspection
from clutchest.record.terminal import print_warnings


def _table(title: str, head: Sequence[str]) -> Table:
    """A narrow one, in which a long name goes on in the next line rather than being cut."""
    columns = [Column(escape(words), overflow="fold") for words in head]
    table = Table(*columns, title=title, title_justify="left", box=SIMPLE_HEAD, pad_edge=False)
    table.padding = (0, 1, 0, 0)
    return table


def print_table_inspection(inspection: TableInspection, console: Console) -> None:
    """Print the columns of tables, those that could serve, and what is missing."""
    columns = _table(
        f"{len(inspection.columns)} columns, {inspection.duration_s:.1f} s",
        ("column", "unit", "numbers", "every [ms]", "from", "to", "could be"),
    )
    for column in inspection.columns:
        likely = [
            name
            for name, found in inspection.candidates.items()
            if column.column in {each.column for each in found}
        ]
        period = column.period_s
        columns.add_row(
            escape(column.column),
            column.unit,
            str(column.count),
            "" if period is None else f"{1e3 * period:.4g}",
            "–" if column.low is None else f"{column.low:.4g}",
            "–" if column.high is None else f"{column.high:.4g}",
            ", ".join(likely),
        )
    console.print(columns)
    for what in inspection.missing:
        console.print(f"missing: {escape(what)}")
    for words in inspection.origin:
        console.print(escape(words))
    print_warnings(inspection.warnings, "inspect.json", console)


def print_inspection(inspection: Inspection, console: Console) -> None:
    """Print the ids of a log, the signals that could serve, and what is missing."""
    several = len({row.channel for row in inspection.rows}) > 1
    j1939 = any(row.pgn is not None for row in inspection.rows)
    channel, pgn = ("channel",) * several, ("PGN",) * j1939
    ids = _table(
        f"{inspection.frames} frames in {inspection.duration_s:.1f} s",
        (*channel, "id", *pgn, "message", "frames", "Hz", "jitter [ms]", "gap [s]", "bytes"),
    )
    for row in inspection.rows:
        ids.add_row(
            *(str(row.channel),) * several,
            f"{row.id:08X}" if row.extended else f"{row.id:03X}",
            *("" if row.pgn is None else str(row.pgn),) * j1939,
            row.message or (row.group or "").partition(":")[0],
            str(row.count),
            "" if row.rate_hz is None else f"{row.rate_hz:.3g}",
            "" if row.jitter_s is None else f"{1e3 * row.jitter_s:.2g}",
            "" if row.gap_s is None else f"{row.gap_s:.3g}",
            "/".join(map(str, row.lengths)),
        )
    console.print(ids)
    signals = _table(
        "signals that may be those of the estimator",
        ("quantity", "could be", "from", "to", "unit"),
    )
    for name, candidates in inspection.candidates.items():
        for candidate in candidates[:3]:
            low, high = candidate.low, candidate.high
            signals.add_row(
                name,
                candidate.where,
                "–" if low is None else f"{low:.4g}",
                "–" if high is None else f"{high:.4g}",
                candidate.unit,
            )
    console.print(signals)
    for reason, count in inspection.rejected.items():
        console.print(f"not read: {count} × {reason}")
    for words in inspection.draft.driveline.words():
        console.print(escape(words))
    for what in inspection.missing:
        console.print(f"missing: {escape(what)}")
    for what in inspection.draft.guesses():
        console.print(f"guessed: {escape(what)}")
    for words in inspection.draft.origin():
        console.print(escape(words))
    print_warnings(inspection.warnings, "inspect.json", console)
