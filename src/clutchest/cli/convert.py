"""``convert``: one format into another."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from clutchest.cli.groups import grouped
from clutchest.cli.options import WHOLE, AsJson, Trust, WindowOptions
from clutchest.cli.parameters import Argument, Option
from clutchest.cli.terminal import loaded, note, print_json, progress

if TYPE_CHECKING:
    from clutchest.reading.conversion import Conversion


@grouped
def convert(
    logs: Annotated[
        list[str],
        Argument(metavar="IN", help="Logs of any known format."),
    ],
    out: Annotated[
        Path,
        Option(
            names=("-o", "--output"),
            metavar="OUT",
            help="The log to write; its suffix says the format.",
        ),
    ],
    vehicle: Annotated[
        str | None,
        Option(
            metavar="V",
            help="Decode CAN logs by this vehicle; OUT is then .csv, .parquet, .xlsx, .mf4 or "
            ".mcap.",
        ),
    ] = None,
    trust: Trust = False,
    window: WindowOptions = WHOLE,
    as_json: AsJson = False,
) -> None:
    """Write logs in another format.

    CAN logs become CAN logs, several of them one, in order of time; decoded tables become tables.
    With a vehicle CAN logs become decoded tables.

    \b
    Example:
      clutchest convert drive.mf4 -o drive.log.gz
      clutchest convert drive.mf4 --vehicle truck -o drive.parquet
      clutchest convert drive.mf4 -o launch.blf --from 60 --to 90
    """
    with progress() as show:
        show("reading", None)
        from clutchest.reading.conversion import Conversion
        from clutchest.record.files import finished_into

        car = None if vehicle is None else loaded(vehicle, trust)
        read = Conversion.of(logs, out, car, window.parse())
        show("writing", None)
        with finished_into(out.parent) as folder:
            losses = read.write(folder / out.name)
    _report(out, read, losses, as_json)


def _report(out: Path, read: Conversion, losses: Iterable[str], as_json: bool) -> None:
    """What was written, what was not read and what the format cannot hold."""
    what = "samples" if read.decoded else "frames"
    if as_json:
        print_json(
            {
                "written": str(out),
                what: read.count,
                "frames_rejected": read.rejected,
                "lost": list(losses),
                "warnings": list(read.notes),
            }
        )
        return
    print(f"Written: {out}, {read.count} {what}")
    for reason, count in read.rejected.items():
        note(f"not read: {count} × {reason}")
    for words in read.notes:
        note(words)
    for loss in losses:
        note(f"not kept: {loss}")
