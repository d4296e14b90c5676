"""``reproduce``: a paper's figures drawn again, and what it states judged."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import click

from clutchest.cli.options import DEFAULT_OUT, AsJson, Out
from clutchest.cli.parameters import Argument
from clutchest.cli.terminal import answer, progress
from clutchest.extras import required

if TYPE_CHECKING:
    from rich.console import Console

    from clutchest.reproduce.claim import Reproduction


def reproduce(
    name: Annotated[
        str,
        Argument(
            metavar="PAPER",
            help="me12: the dry clutch of a heavy truck (Myklebust, Eriksson 2012). "
            "id08: an active limited-slip differential (Ivanović and others 2008).",
        ),
    ],
    out: Out = DEFAULT_OUT,
    as_json: AsJson = False,
) -> None:
    """Draw a paper's figures again; judge what it states.

    Measured data of the papers are not public: the independent simulation stands in for them, with
    imperfections that the table lists.  Writes table.json and the figures; exit code 1 if a row
    fails.

    \b
    Example:
      clutchest reproduce me12 --out me12
    """
    with progress() as show:
        show("loading", None)
        required("matplotlib")
        from clutchest.record.files import finished_into, json_text
        from clutchest.reproduce import paper

        result = paper(name)(show)
        show("drawing", None)
        with finished_into(out) as folder:
            (folder / "table.json").write_text(json_text(result.as_dict()), encoding="utf-8")
            result.draw(folder)
            names = sorted(path.name for path in folder.iterdir())
    answer(result.as_dict(), as_json, lambda console: _print(result, console), out, names)
    if not result.passed:
        raise click.exceptions.Exit(1)


def _print(result: Reproduction, console: Console) -> None:
    """The table, the data's imperfections, and how far each may grow."""
    from rich.markup import escape
    from rich.table import Table

    table = Table(
        "", "stated", "obtained", "", title=result.title, title_justify="left", show_lines=True
    )
    for row in result.rows:
        claim = row.claim
        fails = [name for name, verdict in row.without.items() if not verdict.passed]
        idle = [name for name, verdict in row.without.items() if verdict.passed]
        obtained = escape(row.verdict.obtained)
        if fails:
            obtained += f"\n[dim]fails with: {escape(', '.join(fails))}[/]"
        if idle:
            obtained += f"\n[red]does not fail with: {escape(', '.join(idle))}[/]"
        for name, margin in row.margins.items():
            end = "and more" if margin.fails_at is None else f"fails at {margin.fails_at:.3g}"
            obtained += (
                f"\n[dim]{name} {margin.size:g}: holds up to {margin.holds_at:.3g}, {end}[/]"
            )
        table.add_row(
            claim.name,
            f"{escape(claim.what)} ({claim.figure}): {escape(claim.stated)}",
            obtained,
            "[green]pass[/]" if row.passed else "[red]FAIL[/]",
        )
    console.print(table)
    console.print("Imperfections of the data:")
    for name, (size, unit, what) in result.imperfections.items():
        console.print(f"  {name} {size:g} {'' if unit == '1' else unit}: {escape(what)}")
    for note in result.notes:
        console.print(f"[yellow]note:[/] {escape(note)}")
