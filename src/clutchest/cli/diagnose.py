"""``diagnose``: fault tests."""

from __future__ import annotations

from typing import Annotated

import typer

from clutchest.cli.estimating import estimated
from clutchest.cli.options import DEFAULT_OUT, AsJson, From, Logs, Out, State, To, VehicleName
from clutchest.cli.terminal import answer, progress


def diagnose(
    logs: Logs,
    vehicle: VehicleName,
    explain: Annotated[
        bool,
        typer.Option(
            "--explain",
            help="Also what this drive could show at all, and what it could tell apart.",
        ),
    ] = False,
    state: State = None,
    out: Out = DEFAULT_OUT,
    start: From = None,
    stop: To = None,
    as_json: AsJson = False,
) -> None:
    """Test drives for faults: of messages, of signals, of the actuator and of the clutch.

    Every monitor fails in a healthy vehicle as seldom as the vehicle file asks for
    ([monitors] false_alarms_per_1000h).  One that could not have seen anything says so: not run.
    Writes diagnosis.json and recording.rrd, in which each fault stands with what was known then.

    \b
    Example:
      clutchest diagnose monday.log --vehicle truck --explain --out faults
    """
    with progress() as show:
        show("loading", None)
        from clutchest.diagnosis.diagnose import diagnose as test
        from clutchest.record.diagnosis import print_diagnosis, write_diagnosis

        run = estimated(logs, vehicle, start, stop, state, show, traffic=True)
        found = test(run, progress=show)
        show("writing", None)
        names = [path.name for path in write_diagnosis(found, out)]
    answer(
        found.summary(),
        as_json,
        lambda console: print_diagnosis(found, console, explain),
        out,
        names,
    )
