"""What a discovery says in a terminal, in a few lines."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from textwrap import wrap

from rich.console import Console
from rich.markup import escape
from rich.table import Column, Table

from clutchest.discovery.result import Discovery, Identifiable
from clutchest.record.discovery_report import (
    CAUSES_HEAD,
    causes_rows,
    fit_words,
    gain_words,
    hypotheses_rows,
    next_commands,
    rivals_rows,
    unexcited_words,
    unmeasured_words,
    whereabouts,
)
from clutchest.record.terminal import print_warnings
from clutchest.shown import with_unit

# characters: of a terminal that has room for whole names of rivals; of such a name's lines in a
# narrower one, and of a unit's
WIDE, NARROW, UNIT = 100, 20, 9


def print_discovery(discovery: Discovery, console: Console) -> None:
    """Print the verdict and its causes, the rivals, what the extension gains, and what to do
    next."""
    console.print(escape(fit_words(discovery)))
    console.print(f"[bold]{escape(discovery.sentence)}[/]")
    if words := whereabouts(discovery):
        console.print(escape(words))
    if discovery.causes:
        ambiguous = discovery.verdict == "ambiguous"
        table = Table(
            Column(CAUSES_HEAD[0], no_wrap=True),
            *CAUSES_HEAD[1:],
            title="candidates that the data do not separate" if ambiguous else "causes",
            title_justify="left",
        )
        for row in causes_rows(discovery):
            table.add_row(*map(escape, row))
        console.print(table)
    for name, numbers, why in rivals_rows(discovery):
        console.print(escape(f"rejected: {name} ({numbers}), {why}"))
    for name, numbers, z, rival, why in hypotheses_rows(discovery):
        details = "; ".join(words for words in (numbers, z and f"z {z}", rival, why) if words)
        console.print(escape(f"your {name}: {details}"))
    if discovery.gain:
        console.print(escape(gain_words(discovery.gain, discovery.vehicle.machine.compared)))
    elif discovery.verdict != "none":
        console.print(escape(f"Gain: {unmeasured_words(discovery)}"))
    console.print(escape(unexcited_words(discovery)))
    if discovery.experiment:
        console.print(escape(f"Next: {discovery.experiment.words}"))
    for command in next_commands(discovery):
        console.print(f"  {escape(command)}", soft_wrap=True)
    if not discovery.added:
        name = discovery.vehicle.path.name
        console.print(escape(f"Nothing was added to the model: extended.toml is {name} as it was."))
    print_warnings(discovery.warnings, "report.md", console)


def print_identifiable(effects: Sequence[Identifiable], console: Console) -> None:
    """Print what a log can reveal of every effect."""
    whole = partial(Column, no_wrap=True)
    room = NARROW if console.width < WIDE else console.width
    table = Table(
        whole("effect"),
        whole("detect-\nable at"),
        whole("plausible\nup to"),
        Column("", min_width=UNIT),
        whole("nearest rival"),
        whole("d′"),
        title="identifiability: size detected in 50 % of such logs, separability d′ (σ)",
        title_justify="left",
        box=None,
        padding=(0, 1, 0, 0),
        pad_edge=False,
    )
    for i in effects:
        table.add_row(
            i.effect,
            "never" if i.detectable_size is None else f"{i.detectable_size:.3g}",
            f"{i.plausible_size:.3g}",
            escape(with_unit("", i.unit)),
            _in_lines(i.nearest or "", room),
            "" if i.d_prime_nearest is None else f"{i.d_prime_nearest:.1f}",
            style=None if i.excited else "dim",
        )
    console.print(table)


def _in_lines(name: str, room: int) -> str:
    """A name that breaks after underscores where it has more characters than there is ``room``."""
    return "\n".join(line.replace("_ ", "_") for line in wrap(name.replace("_", "_ "), room))
