"""What a run says in a terminal: states, slip events and doubts, in a few lines."""

from __future__ import annotations

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from clutchest.estimate.run import Run
from clutchest.record.quantities import Quantity, states_of
from clutchest.record.report import plus_minus

_MOST_WARNINGS = 8


def print_run(run: Run, console: Console) -> None:
    """Print the final states, the slip events in one line, and the warnings of ``run``."""
    summary = run.summary
    title = f"{escape(run.vehicle.name)}: {summary['duration_s']:.0f} s"
    if len(run.tracks) > 1:
        title += f", {len(run.tracks)} drives"
    table = Table("quantity", "value ± 1σ", "", title=f"{title}, at the end", title_justify="left")
    for name, quantity in states_of(run).items():
        state = summary["states"][name]
        shown = plus_minus(quantity, state["value"], state["std"])
        if state["valid"]:
            table.add_row(quantity.words, shown, "", style="bold")
        else:
            table.add_row(quantity.words, shown, f"not valid: {escape(state['why'] or 'uncertain')}",
                          style="dim")  # fmt: skip
    console.print(table)
    console.print(_slip_events(run))
    warnings = [str(text) for text in summary["warnings"]]
    for text in warnings[:_MOST_WARNINGS]:
        console.print(f"[yellow]warning:[/] {escape(text)}")
    if len(warnings) > _MOST_WARNINGS:
        console.print(f"… and {len(warnings) - _MOST_WARNINGS} more warnings in summary.json")


def _slip_events(run: Run) -> str:
    events = [event for track in run.tracks for event in track.engagements]
    if not events:
        return "The clutch never slipped."
    energy = sum(event.energy_J for event in events)
    # Parameters are the same in every event: their errors add up rather than average out.
    spread = sum(event.energy_std_J for event in events)
    hottest = np.nanmax([event.peak_temp_disc for event in events])
    return (f"{len(events)} slip event{'s' if len(events) > 1 else ''}, "
            f"{plus_minus(Quantity('energy', 'J'), energy, spread)} of heat, "
            f"disc at most {hottest:.0f} °C.")  # fmt: skip
