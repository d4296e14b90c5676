"""Vector's binary log."""

from __future__ import annotations

from clutchest.can.formats.blf.reader import read
from clutchest.can.formats.blf.writer import write
from clutchest.can.log_format import LogFormat, begins_with

FORMAT = LogFormat(
    title=".blf",
    about="Vector: CAN, CAN FD and error objects; containers packed, stored, nested or none",
    suffix=".blf",
    sniff=begins_with(b"LOGG"),
    read=read,
    save=write,
)
