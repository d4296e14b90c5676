"""Vector's binary log."""

from __future__ import annotations

from collections.abc import Iterator

from clutchest.can.formats.blf.writer import write
from clutchest.can.frames import Frames
from clutchest.can.log_format import LogFormat, begins_with
from clutchest.can.log_source import LogSource


def read(source: LogSource) -> Iterator[Frames]:
    """The frames of such a log, block by block."""
    from clutchest.can.formats.blf import reader  # compiled functions, which take a while to load

    return reader.read(source)


FORMAT = LogFormat(
    title=".blf",
    about="Vector: CAN, CAN FD and error objects; containers packed, stored, nested or none",
    suffix=".blf",
    sniff=begins_with(b"LOGG"),
    read=read,
    save=write,
)
