"""``inspect``: a first look at a log."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from clutchest.cli.options import DEFAULT_OUT, AsJson, From, Logs, Out, To
from clutchest.cli.terminal import answer, progress


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
            help="The machine whose signals are looked for: one by name, or your own file.  "
            "Without it the shipped one of which most signals are there.",
        ),
    ] = "",
    out: Out = DEFAULT_OUT,
    start: From = None,
    stop: To = None,
    as_json: AsJson = False,
) -> None:
    """Say what is in a log, and draft a vehicle file for it.

    Lists ids, rates and gaps, and the signals that look like those the estimator needs.  Writes
    inspect.json and vehicle.toml; the heading of the latter names what is still missing.

    \b
    Example:
      clutchest inspect drive.log --dbc vehicle.dbc --out first-look
      clutchest inspect bench.log --dbc servo.dbc --model servo.py
    """
    with progress() as show:
        show("reading", None)
        from clutchest.reading.inspection import inspect_logs
        from clutchest.reading.window import TimeWindow
        from clutchest.record.files import finished_into, json_text
        from clutchest.record.terminal import print_inspection

        found = inspect_logs(logs, dbc or (), TimeWindow.parse(start, stop), model)
        with finished_into(out) as folder:
            (folder / "inspect.json").write_text(json_text(found.as_dict()), encoding="utf-8")
            draft = found.vehicle_toml(out / "vehicle.toml")
            (folder / "vehicle.toml").write_text(draft, encoding="utf-8")
            names = sorted(path.name for path in folder.iterdir())
    answer(found.as_dict(), as_json, lambda console: print_inspection(found, console), out, names)
