"""A run in a terminal in a few lines."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rich.box import SIMPLE
from rich.console import Console
from rich.markup import escape
from rich.table import Column, Table

from clutchest.estimate.run import Run
from clutchest.quantity import Quantity
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
from clutchest.record.tracking import judder_words, tracking_head, tracking_note, tracking_rows

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
    for words in judder_words(run):
        console.print(escape(words))
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
        *(
            Column(escape(words.replace(" [", "\n[")), justify="right")
            for words in tracking_head(run)
        ),
        title="tracking",
        box=SIMPLE,
        padding=(0, 1, 0, 0),
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
