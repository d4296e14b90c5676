"""What the verbs ask for alike: logs, a vehicle, a folder, JSON instead of words."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from clutchest.errors import ClutchestError

Logs = Annotated[
    list[str],
    typer.Argument(
        metavar="LOG",
        show_default=False,
        help="CAN logs (.log .asc .blf .trc .csv .mf4 .db, also .gz), decoded .csv or .parquet, or "
        "the name of a shipped log: demo.",
    ),
]
VehicleName = Annotated[
    str,
    typer.Option(
        "--vehicle",
        metavar="V",
        show_default=False,
        help="A vehicle file, or a shipped vehicle: truck, gt350, j1939_t270, alsd_rig, alsd_car.",
    ),
]
State = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        show_default=False,
        help="state.json of the drive before: its estimates carry over.",
    ),
]
Interface = Annotated[
    str,
    typer.Option(
        "--interface",
        "-i",
        metavar="I",
        show_default=False,
        help="An interface of python-can: socketcan, pcan, kvaser, vector, slcan, …; udp_multicast "
        "needs no hardware.",
    ),
]
Channel = Annotated[
    str | None,
    typer.Option(
        "--channel",
        "-c",
        metavar="C",
        show_default=False,
        help="Its channel: can0, PCAN_USBBUS1, …; may be left out where the interface has one.",
    ),
]
From = Annotated[
    str | None,
    typer.Option(
        "--from",
        metavar="T",
        show_default=False,
        help="Leave out what lies before: s from each drive's start, or a date like "
        "2024-01-18T10:30:00+01:00 (without a zone: local time).",
    ),
]
To = Annotated[
    str | None,
    typer.Option(
        "--to", metavar="T", show_default=False, help="Leave out what lies after, likewise."
    ),
]


def _folder(out: Path) -> Path:
    """That results can be put there is asked before the work, not after it."""
    nearest = next(place for place in (out, *out.absolute().parents) if place.exists())
    if not nearest.is_dir():
        raise ClutchestError(f"{nearest}: is a file, expected a folder for the results")
    if not os.access(nearest, os.W_OK):
        raise ClutchestError(f"{nearest}: must not be written to, expected a folder that may")
    return out


Out = Annotated[
    Path,
    typer.Option("--out", metavar="DIR", help="Folder for the results.", callback=_folder),
]
AsJson = Annotated[
    bool,
    typer.Option(
        "--json", help="Print the machine-readable result on stdout, and nothing else there."
    ),
]
DEFAULT_OUT = Path("clutchest-out")


def apart(logs: list[str], holdout: list[str] | tuple[()]) -> None:
    """No log may both find a cause and measure what it is worth."""
    used = {Path(log).resolve() for log in logs}
    for log in holdout:
        if Path(log).resolve() in used:
            raise ClutchestError(f"{log}: is given as LOG and as --holdout, expected another log")
