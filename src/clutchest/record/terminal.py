"""A run, or the inspection of a log, in a terminal in a few lines."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rich.box import SIMPLE
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from clutchest.estimate.run import Run
from clutchest.quantity import Quantity
from clutchest.reading.inspection import Inspection
from clutchest.reading.table_inspection import TableInspection
from clutchest.record.quantities import states_of
from clutchest.record.report import (
    BITS,
    contradiction,
    event_words,
    hottest_words,
    informed,
    no_event_words,
    plus_minus,
)
from clutchest.record.tracking import tracking_head, tracking_note, tracking_rows

_MOST_WARNINGS = 8
_MOST_ACTUATIONS = 8


def print_run(run: Run, console: Console) -> None:
    """Print the final states with their source of information, slip events and wear in a line or
    two each, and the warnings of ``run``."""
    summary = run.summary
    for words in contradiction(run):
        console.print(f"[bold red]{escape(words)}[/]")
    title = f"{escape(run.vehicle.name)}: {summary['duration_s']:.0f} s"
    if len(run.tracks) > 1:
        title += f", {len(run.tracks)} drives"
    table = Table(
        "quantity",
        "value ± 1σ",
        "valid",
        "source of information /\nreason missing",
        title=f"{title}, at the end",
        title_justify="left",
        caption=BITS,
        caption_justify="left",
    )
    for name, quantity in states_of(run).items():
        state = summary["states"][name]
        shown = plus_minus(quantity, state["value"], state["std"])
        known, style = ("yes", "bold") if state["valid"] else ("no", "dim")
        table.add_row(quantity.words, shown, known, escape(informed(state)), style=style)
    console.print(table)
    if run.vehicle.machine.event:
        console.print(_slip_events(run))
    _print_tracking(run, console)
    for words in summary["wear"]["words"] if summary["wear"] else ():
        console.print(escape(words))
    for reason, count in summary["frames_rejected"].items():
        console.print(f"not used: {count} × {escape(reason)}")
    print_warnings([str(text) for text in summary["warnings"]], "summary.json", console)


def _print_tracking(run: Run, console: Console) -> None:
    """Print how the output followed the first actuations."""
    rows = tracking_rows(run)
    if not rows:
        return
    table = Table(
        *tracking_head(run),
        title="tracking",
        box=SIMPLE,
        title_justify="left",
        caption=tracking_note(run),
        caption_justify="left",
    )
    for row in rows[:_MOST_ACTUATIONS]:
        table.add_row(*row)
    console.print(table)
    if len(rows) > _MOST_ACTUATIONS:
        console.print(f"… and {len(rows) - _MOST_ACTUATIONS} more actuations in summary.json")


def print_warnings(warnings: Sequence[str], rest_in: str, console: Console) -> None:
    """Print the first warnings, and in which file the others are."""
    for text in warnings[:_MOST_WARNINGS]:
        console.print(f"[yellow]warning:[/] {escape(text)}")
    if len(warnings) > _MOST_WARNINGS:
        console.print(f"… and {len(warnings) - _MOST_WARNINGS} more warnings in {rest_in}")


def _slip_events(run: Run) -> str:
    events = [event for track in run.tracks for event in track.engagements]
    if not events:
        return no_event_words(run)
    energy = sum(event.energy_J for event in events)
    # Parameters are the same in every event: their errors add up rather than average out.
    spread = sum(event.energy_std_J for event in events)
    seconds = sum(event.duration_s for event in events)
    words = f"{len(events)} {event_words(run)[len(events) > 1]} in {seconds:.1f} s"
    if any(track.contradiction for track in run.tracks):
        return f"{words}."
    words += f", {plus_minus(Quantity('energy', 'J'), energy, spread)} of heat"
    peaks = [event.peak_temp_disc for event in events if np.isfinite(event.peak_temp_disc)]
    return f"{words}, {hottest_words(run)} at most {max(peaks):.0f} °C." if peaks else f"{words}."


def print_table_inspection(inspection: TableInspection, console: Console) -> None:
    """Print the columns of tables, those that could serve, and what is missing."""
    columns = Table(
        "column",
        "unit",
        "numbers",
        "every [ms]",
        "from",
        "to",
        "could be",
        title=f"{len(inspection.columns)} columns, {inspection.duration_s:.1f} s",
        title_justify="left",
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
    print_warnings(inspection.warnings, "inspect.json", console)


def print_inspection(inspection: Inspection, console: Console) -> None:
    """Print the ids of a log, the signals that could serve, and what is missing."""
    ids = Table(
        "channel",
        "id",
        "PGN",
        "message",
        "frames",
        "Hz",
        "jitter [ms]",
        "largest gap [s]",
        "bytes",
        title=f"{inspection.frames} frames in {inspection.duration_s:.1f} s",
        title_justify="left",
    )
    for row in inspection.rows:
        ids.add_row(
            str(row.channel),
            f"{row.id:08X}" if row.extended else f"{row.id:03X}",
            "" if row.pgn is None else str(row.pgn),
            row.message or (row.group or "").partition(":")[0],
            str(row.count),
            "" if row.rate_hz is None else f"{row.rate_hz:.3g}",
            "" if row.jitter_s is None else f"{1e3 * row.jitter_s:.2g}",
            "" if row.gap_s is None else f"{row.gap_s:.3g}",
            "/".join(map(str, row.lengths)),
        )
    console.print(ids)
    signals = Table(
        "quantity",
        "could be",
        "from",
        "to",
        "unit",
        title_justify="left",
        title="signals that may be those of the estimator",
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
    print_warnings(inspection.warnings, "inspect.json", console)
