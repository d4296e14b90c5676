"""``replay``: estimates over recorded drives."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from clutchest.cli.options import DEFAULT_OUT, AsJson, From, Logs, Out, To, VehicleName
from clutchest.cli.terminal import answer, progress


def replay(
    logs: Logs,
    vehicle: VehicleName,
    out: Out = DEFAULT_OUT,
    state: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            show_default=False,
            help="state.json of the drive before: its estimates carry over.",
        ),
    ] = None,
    rate: Annotated[
        float,
        typer.Option(metavar="HZ", min=0.01, max=1000.0, help="Rows per second of the estimates."),
    ] = 10.0,
    smooth: Annotated[
        bool,
        typer.Option("--smooth", help="Also the estimates that each whole drive supports."),
    ] = False,
    innovations: Annotated[
        bool, typer.Option("--innovations", help="Also write innovations.parquet: every misfit.")
    ] = False,
    start: From = None,
    stop: To = None,
    as_json: AsJson = False,
) -> None:
    """Estimate temperatures, wear and friction over recorded drives.

    Writes estimates.parquet, summary.json, recording.rrd (open it with `rerun`) and state.json.
    Logs whose clocks join are pieces of one drive, others drives of their own.

    \b
    Example:
      clutchest replay monday.log tuesday.log --vehicle truck --out results
      clutchest replay wednesday.log --vehicle truck --state results/state.json
      clutchest replay monday.log --vehicle truck --from 60 --to 300
    """
    with progress() as show:
        show("loading", None)
        from clutchest.errors import ClutchestError
        from clutchest.estimate.replay import replay as estimate
        from clutchest.estimate.start import StateError
        from clutchest.reading import read_log
        from clutchest.reading.window import Window
        from clutchest.record.files import read_state, write_run
        from clutchest.record.terminal import print_run
        from clutchest.vehicle import load_vehicle

        car = load_vehicle(vehicle)
        before = None if state is None else read_state(state)
        show("reading", None)
        signals = read_log(logs, car, Window.parse(start, stop))
        try:
            run = estimate(signals, car, rate=rate, state=before, smooth=smooth, progress=show)
        except StateError as problem:
            raise ClutchestError(f"{state}: {problem}") from None
        show("writing", None)
        written = write_run(run, out, innovations=innovations)
    names = [path.name for path in written]
    answer(run.summary, as_json, lambda console: print_run(run, console), out, names)
