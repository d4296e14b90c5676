"""``inspect``: ids, rates and candidate signals of a log."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from clutchest.cli.groups import grouped
from clutchest.cli.options import DEFAULT_OUT, WHOLE, AsJson, Logs, Out, WindowOptions
from clutchest.cli.terminal import answer, progress


@grouped
def inspect(
    logs: Logs,
    dbc: Annotated[
        list[Path] | None,
        typer.Option(
            "--dbc",
            metavar="FILE",
            show_default=False,
            help="Names the messages; repeat for several.  Without it the shipped ones do.",
        ),
    ] = None,
    model: Annotated[
        str,
        typer.Option(
            "--model",
            metavar="NAME|FILE.py",
            show_default=False,
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
      clutchest inspect bench.log --dbc servo.dbc --model servo.py
    """
    with progress() as show:
        show("reading", None)
        from clutchest.reading.inspection import inspect_logs
        from clutchest.record.files import finished_into, json_text
        from clutchest.record.terminal import print_inspection

        inspection = inspect_logs(logs, dbc or (), window.parse(), model)
        with finished_into(out) as folder:
            (folder / "inspect.json").write_text(json_text(inspection.as_dict()), encoding="utf-8")
            inspection.write_vehicle(folder / "vehicle.toml", out / "vehicle.toml")
            names = sorted(path.name for path in folder.iterdir())
    result = inspection.as_dict()
    answer(result, as_json, lambda console: print_inspection(inspection, console), out, names)
