"""``inspect``: ids, rates and candidate signals of a log."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from clutchest.cli.groups import grouped
from clutchest.cli.options import DEFAULT_OUT, WHOLE, AsJson, Logs, Out, WindowOptions
from clutchest.cli.parameters import Option
from clutchest.cli.terminal import answer, progress
from clutchest.errors import ClutchestError
from clutchest.shipped import shipped

if TYPE_CHECKING:
    from rich.console import Console

    from clutchest.can.database import DatabaseFile
    from clutchest.reading.inspection import Inspection
    from clutchest.reading.table_inspection import TableInspection


@grouped
def inspect(
    logs: Logs,
    dbc: Annotated[
        list[str] | None,
        Option(
            metavar="[N=]FILE",
            help="Names the messages, with N= those of channel N only; repeat for several.  A "
            f"file, or a shipped DBC: {', '.join(shipped('dbc'))}.  Without it all of these do.",
        ),
    ] = None,
    model: Annotated[
        str,
        Option(
            metavar="NAME|FILE.py",
            help="The machine whose signals are searched: one by name, or your own file.  "
            "Without it the shipped one of which most signals are there.",
        ),
    ] = "",
    out: Out = DEFAULT_OUT,
    window: WindowOptions = WHOLE,
    as_json: AsJson = False,
) -> None:
    """Say what is in a log, and draft a vehicle file for it.

    Lists ids, rates and gaps, and the signals that may be those of the estimator.  Writes
    inspect.json and vehicle.toml; the heading of the latter names what is still missing.

    \b
    Example:
      clutchest inspect drive.log --dbc vehicle.dbc --out first
      clutchest inspect drive.asc --dbc 0=engine.dbc --dbc 1=chassis.dbc
      clutchest inspect bench.log --dbc servo.dbc --model servo.py
    """
    with progress() as show:
        show("reading", None)
        from clutchest.record.files import finished_into, json_text

        inspection = _inspected(logs, dbc or (), window, model)
        with finished_into(out) as folder:
            (folder / "inspect.json").write_text(json_text(inspection.as_dict()), encoding="utf-8")
            inspection.write_vehicle(folder / "vehicle.toml", out / "vehicle.toml")
            names = sorted(path.name for path in folder.iterdir())

    answer(inspection.as_dict(), as_json, lambda console: _show(inspection, console), out, names)


def _inspected(
    logs: Sequence[str], dbc: Sequence[str], window: WindowOptions, model: str
) -> Inspection | TableInspection:
    """What is in logs of frames, or in tables."""
    from clutchest.reading.inspection import inspect_logs
    from clutchest.reading.table_formats import is_table
    from clutchest.reading.table_inspection import inspect_tables
    from clutchest.shipped import locate

    tables = [is_table(locate(log, "logs")) for log in logs]
    if all(tables):
        return inspect_tables(logs, model)
    if any(tables):
        table, frames = (logs[tables.index(kind)] for kind in (True, False))
        raise ClutchestError(
            f"{table} holds decoded signals, {frames} holds frames; inspect them one after the "
            "other, since each kind has a vehicle file of its own"
        )
    return inspect_logs(logs, [_database(each) for each in dbc], window.parse(), model)


def _database(given: str) -> DatabaseFile:
    """``FILE``, or ``N=FILE``: that of one channel."""
    from clutchest.can.database import DatabaseFile

    channel, _, path = given.partition("=")
    if path and channel.isdecimal():
        return DatabaseFile(Path(path), int(channel))
    return DatabaseFile(Path(given))


def _show(inspection: Inspection | TableInspection, console: Console) -> None:
    from clutchest.reading.inspection import Inspection
    from clutchest.record.inspection_terminal import print_inspection, print_table_inspection

    if isinstance(inspection, Inspection):
        print_inspection(inspection, console)
    else:
        print_table_inspection(inspection, console)
