"""``fleet``: many logs of many vehicles."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

from clutchest.cli.groups import grouped
from clutchest.cli.options import DEFAULT_OUT, AsJson, Out, Rate, Trust, VehicleName
from clutchest.cli.parameters import Argument, Option
from clutchest.cli.terminal import answer, meanwhile, print_shown, progress
from clutchest.extras import installed
from clutchest.shipped import shipped
from clutchest.shown import counted

if TYPE_CHECKING:
    from rich.console import Console

    from clutchest.fleet.fleet import Fleet

NAMED = 3  # logs that are named of those not used for the same reason
SHOWN = 10  # reasons


@dataclass(frozen=True, slots=True)
class ClusterOptions:
    """Where the work is done."""

    scheduler: Annotated[
        str | None,
        Option(
            metavar="ADDRESS",
            help="A Dask scheduler, tcp://host:8786, whose workers see the same files; without it "
            "processes of this machine.",
        ),
    ] = None
    workers: Annotated[
        int | None,
        Option(metavar="N", least=1, help="So many of these processes."),
    ] = None


HERE = ClusterOptions()


@grouped
def fleet(
    places: Annotated[
        list[str],
        Argument(
            metavar="FOLDER",
            help="Folders of logs, at any depth, patterns, logs, or names of shipped logs: "
            f"{', '.join(shipped('logs'))}; the folder below the one that is given names the "
            "vehicle.",
        ),
    ],
    vehicle: VehicleName,
    where: ClusterOptions = HERE,
    rate: Rate = 10.0,
    trust: Trust = False,
    out: Out = DEFAULT_OUT,
    as_json: AsJson = False,
) -> None:
    """Estimate over the logs of a fleet; compare its vehicles.

    Writes fleet.parquet (estimates by vehicle and day), summary.parquet (a row for each vehicle:
    what it keeps, its wear per MJ with 95 % intervals, and whether it differs from the others),
    drives.parquet and report.html.  Started again it goes on where it stopped.

    \b
    Example:
      clutchest fleet trucks --vehicle truck --out result
      clutchest fleet 'logs/**/*.blf' --vehicle truck --scheduler tcp://host:8786
    """
    with progress() as show:
        show("loading", None)
        from clutchest.fleet.files import write_fleet
        from clutchest.fleet.fleet import analyse_fleet

        drawn = ["clutchest.fleet.picture"] if installed("matplotlib") else []
        meanwhile("pandas", "scipy.special", *drawn)
        result = analyse_fleet(
            places,
            vehicle,
            out,
            scheduler=where.scheduler,
            workers=where.workers,
            trust=trust,
            rate=rate,
            progress=show,
        )
        show("writing", None)
        names = [path.name for path in write_fleet(result, out)]
    answer(
        _as_json(result),
        as_json,
        lambda console: _print(result, console),
        out,
        names,
    )


def _as_json(result: Fleet) -> dict[str, Any]:
    return {
        "vehicles": result.rows(),
        "outliers": result.outliers,
        "rejected": result.rejected,
        "contradicting": result.contradicting,
        "notes": result.notes,
    }


def _print(result: Fleet, console: Console) -> None:
    """Who differs in what, what was not used or contradicts the model, and the table."""
    from rich.markup import escape

    print_shown(result.shown(), console)
    for words in result.differences():
        console.print(f"[bold red]{escape(words)}[/]")
    _print_logs("not used", result.rejected, console)
    _print_logs("signals contradict the model", result.contradicting, console)
    _print_logs("note", result.notes, console)


def _print_logs(head: str, said: Mapping[str, str], console: Console) -> None:
    """Of logs, what is said of them; those of which the same is said together."""
    from rich.markup import escape

    reasons = list(dict.fromkeys(said.values()))
    for why in reasons[:SHOWN]:
        logs = [log for log, reason in said.items() if reason == why]
        more = f" and {len(logs) - NAMED} more" if len(logs) > NAMED else ""
        console.print(f"[yellow]{head}:[/] {escape(', '.join(logs[:NAMED]))}{more}: {escape(why)}")
    if rest := sum(why in reasons[SHOWN:] for why in said.values()):
        console.print(f"[yellow]{head}:[/] {counted(rest, 'more log')}, see report.html")
