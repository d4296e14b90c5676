"""What a discovery says in a terminal, in a few lines."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from rich.console import Console
from rich.markup import escape
from rich.table import Column, Table

from clutchest.discovery.result import Discovery, Identifiable
from clutchest.record.discovery import (
    causes_rows,
    gain_words,
    next_commands,
    rivals_rows,
    unexcited_words,
    unmeasured_words,
    whereabouts,
)
from clutchest.record.terminal import print_warnings


def print_discovery(discovery: Discovery, console: Console) -> None:
    """Print the verdict and its causes, the rivals, what the extension is worth, and what to do
    next."""
    console.print(f"[bold]{escape(discovery.sentence)}[/]")
    if words := whereabouts(discovery):
        console.print(escape(words))
    if discovery.causes:
        heading = (
            "candidates, not to be told apart" if discovery.verdict == "ambiguous" else "causes"
        )
        table = Table(
            Column("effect", no_wrap=True),
            "fitted ± 1σ",
            "gain in\n−2 ln p",
            "chance by\nnoise alone",
            title=heading,
            title_justify="left",
        )
        for row in causes_rows(discovery):
            table.add_row(*map(escape, row))
        console.print(table)
    for name, numbers, why in rivals_rows(discovery.rivals):
        console.print(escape(f"not {name} ({numbers}): {why}"))
    if discovery.gain:
        console.print(escape(gain_words(discovery.gain)))
    elif discovery.verdict != "none":
        console.print(escape(f"Gain: {unmeasured_words(discovery)}"))
    console.print(escape(unexcited_words(discovery)))
    if discovery.experiment:
        console.print(escape(f"Next: {discovery.experiment.words}"))
    for command in next_commands(discovery):
        console.print(f"  {escape(command)}", soft_wrap=True)
    print_warnings(discovery.warnings, "report.md", console)


def print_identifiable(tells: Sequence[Identifiable], console: Console) -> None:
    """Print what a log can tell of every cause."""
    whole = partial(Column, no_wrap=True)  # on 80 columns, units give way
    table = Table(
        whole("effect"),
        whole("shows\nfrom"),
        whole("plausible\nup to"),
        "",
        whole("nearest rival"),
        whole("apart\nby d′"),
        title="what this log can tell",
        title_justify="left",
        box=None,
        padding=(0, 1, 0, 0),
        pad_edge=False,
    )
    for i in tells:
        table.add_row(
            i.effect,
            "never" if i.detectable_size is None else f"{i.detectable_size:.3g}",
            f"{i.plausible_size:.3g}",
            "" if i.unit == "1" else escape(i.unit),
            i.nearest or "",
            "" if i.d_prime_nearest is None else f"{i.d_prime_nearest:.1f}",
            style=None if i.excited else "dim",
        )
    console.print(table)
