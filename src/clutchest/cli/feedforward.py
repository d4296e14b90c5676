"""``feedforward``: what the actuator has to do for a requested output."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from clutchest.cli.options import (
    DEFAULT_OUT,
    AsJson,
    Out,
    State,
    TableFormat,
    Trust,
    VehicleName,
)
from clutchest.cli.parameters import Argument, Option
from clutchest.cli.terminal import answer, print_shown, progress

if TYPE_CHECKING:
    from rich.console import Console

    from clutchest.estimate.feedforward import Feedforward


def feedforward(
    request: Annotated[
        str,
        Argument(
            metavar="REQUEST",
            help="A table (.csv, .parquet) with the request over time, or a log of the vehicle "
            "that has it.",
        ),
    ],
    vehicle: VehicleName,
    trust: Trust = False,
    state: State = None,
    out: Out = DEFAULT_OUT,
    formats: Annotated[
        list[TableFormat] | None,
        Option(
            names=("--format",),
            metavar="csv|xlsx|mf4|mcap",
            help="Also write feedforward.csv, …; repeat for several.",
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """What the actuator has to do for a requested output.

    Writes feedforward.parquet: time, the request, and what the machine's actuator does.

    \b
    Example:
      clutchest feedforward request.csv --vehicle alsd_rig --out plan --format csv
      clutchest feedforward request.csv --vehicle alsd_rig --state out/state.json
    """
    with progress() as show:
        show("loading", None)
        from clutchest.estimate.feedforward import feedforward as inverse
        from clutchest.record.feedforward import write_feedforward
        from clutchest.record.files import read_state
        from clutchest.vehicle import load_vehicle

        car = load_vehicle(vehicle, trust=trust)
        before = None if state is None else read_state(state)
        show("calculating", None)
        found = inverse(car, request, state=before)
        names = [path.name for path in write_feedforward(found, out, formats or ())]
    answer(
        {
            "out": str(out),
            "files": names,
            "taken": dict(found.taken),
            "ranges": found.ranges,
            "unmet": found.unmet,
            "warnings": list(found.warnings),
        },
        as_json,
        lambda console: _print(found, console),
        out,
        names,
    )


def _print(found: Feedforward, console: Console) -> None:
    """Print the range of every column, and what is wrong with the request."""
    from clutchest.record.terminal import print_warnings

    print_shown(found.shown(), console)
    print_warnings(found.warnings, "--json", console)
