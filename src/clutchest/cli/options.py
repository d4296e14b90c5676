"""Options that several verbs have: logs, a vehicle, a folder, a time window, JSON."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import click

from clutchest.cli.parameters import Argument, Option
from clutchest.errors import ClutchestError
from clutchest.shipped import shipped

if TYPE_CHECKING:
    from clutchest.reading.window import TimeWindow


class TableFormat(StrEnum):
    """As ``clutchest.reading.table_formats`` has them, beside Parquet."""

    csv = "csv"
    xlsx = "xlsx"
    mf4 = "mf4"
    mcap = "mcap"


Logs = Annotated[
    list[str],
    Argument(
        metavar="LOG",
        help="CAN logs (.log .asc .blf .trc .csv .mf4 .db, also .gz), decoded signals (.csv "
        ".parquet .xlsx .mf4 .mat .tdms), or the name of a shipped log: alsd, demo.",
    ),
]
VehicleName = Annotated[
    str,
    Option(
        metavar="V",
        help=f"A vehicle file, or a shipped vehicle: {', '.join(shipped('vehicles'))}.",
    ),
]
Trust = Annotated[
    bool,
    Option(
        help="Run the Python files that the vehicle file names, this time, without `clutchest "
        "trust`.",
    ),
]
State = Annotated[
    Path | None,
    Option(
        metavar="FILE",
        help="state.json of the drive before: its estimates carry over.",
    ),
]
Interface = Annotated[
    str,
    Option(
        names=("--interface", "-i"),
        metavar="I",
        help="An interface of python-can: socketcan, pcan, kvaser, vector, slcan, …; udp_multicast "
        "needs no hardware.",
    ),
]
Channel = Annotated[
    str | None,
    Option(
        names=("--channel", "-c"),
        metavar="C",
        help="Its channel: can0, PCAN_USBBUS1, …; may be left out where the interface has one.",
    ),
]
From = Annotated[
    str | None,
    Option(
        names=("--from",),
        metavar="T",
        help="Leave out what lies before: s from each drive's start, or a date like "
        "2024-01-18T10:30:00+01:00 (without a zone: local time).",
    ),
]
To = Annotated[
    str | None,
    Option(names=("--to",), metavar="T", help="Leave out what lies after, likewise."),
]


Holdout = Annotated[
    list[str] | None,
    Option(
        metavar="LOG",
        help="A log that is not fitted, only used to measure what the result gains; repeat for "
        "several.",
    ),
]


@dataclass(frozen=True, slots=True)
class WindowOptions:
    """Which part of every drive."""

    start: From = None
    stop: To = None

    def parse(self) -> TimeWindow:
        """As readers take it.  Raises ClutchestError for what is no time."""
        from clutchest.reading.window import TimeWindow

        return TimeWindow.parse(self.start, self.stop)


WHOLE = WindowOptions()


@dataclass(frozen=True, slots=True)
class SourceOptions:
    """Drives to estimate over: logs of a vehicle, and the state that the drive before left."""

    logs: Logs
    vehicle: VehicleName
    trust: Trust = False
    state: State = None


def _folder(out: Path) -> Path:
    """That results can be written there is checked before the work, not after it."""
    nearest = next(place for place in (out, *out.absolute().parents) if place.exists())
    if not nearest.is_dir():
        raise ClutchestError(f"{nearest}: is a file, expected a folder for the results")
    if not os.access(nearest, os.W_OK):
        raise ClutchestError(f"{nearest}: is not writable, expected a folder that is")
    return out


def within(low: float, high: float = math.inf) -> Callable[[float | None], float | None]:
    """The callback of every option that takes a number: finite, from ``low`` to ``high``."""

    def check(value: float | None) -> float | None:
        if value is None or (math.isfinite(value) and low <= value <= high):
            return value
        expected = f"of at least {low:g}" if high == math.inf else f"from {low:g} to {high:g}"
        raise click.BadParameter(f"{value:g}; expected a number {expected}")

    return check


Out = Annotated[
    Path,
    Option(metavar="DIR", help="Folder for the results.", check=_folder),
]
AsJson = Annotated[
    bool,
    Option(
        names=("--json",),
        help="Print the machine-readable result on stdout, and nothing else there.",
    ),
]
Rate = Annotated[
    float,
    Option(
        metavar="HZ",
        check=within(0.01, 1000.0),
        help="Rows per second of the estimates, 0.01 to 1000.",
    ),
]
DEFAULT_OUT = Path("clutchest-out")


def disjoint(logs: list[str], holdout: list[str] | tuple[()]) -> None:
    """No log may both be fitted and measure the gain."""
    used = {Path(log).resolve() for log in logs}
    for log in holdout:
        if Path(log).resolve() in used:
            raise ClutchestError(f"{log}: is given as LOG and as --holdout, expected another log")
