"""Any other csv whose header names time, id and data, as CANalyzer and CANcaseXL export it:
``Time[s];Channel;ID;Dir;DLC;Data``, Cabana's ``time,addr,bus,data``, and their like.

The header states the unit of the time, s otherwise; ids are hexadecimal unless it says ``dec``.
"""

from __future__ import annotations

from collections.abc import Iterator

from clutchest.can.csv_frames import frames_of
from clutchest.can.csv_header import Header, header_of, headers
from clutchest.can.formats import csv as of_python_can
from clutchest.can.formats import gvret, kvaser_csv, vehicle_spy
from clutchest.can.frames import Frames
from clutchest.can.log_format import LogFormat
from clutchest.can.log_source import LogSource

_OTHERS = (of_python_can, gvret, kvaser_csv, vehicle_spy)


def _sniff(head: bytes) -> int | None:
    if any(other.FORMAT.sniff(head) is not None for other in _OTHERS):
        return None
    return next((h.begin for h in headers(head) if h.holds_frames()), None)


def read(source: LogSource) -> Iterator[Frames]:
    """Frames of such a log; lines that cannot be read are counted in ``rejected``."""
    header = header_of(source, Header.holds_frames)
    numbered = "bus" in (name.lower() for name in header.names)
    return frames_of(source, header, first_channel=0 if numbered else None)


FORMAT = LogFormat(
    title="csv of named columns",
    about="any whose header names time, id and data, such as CANalyzer's and CANcaseXL's",
    suffix=".csv",
    sniff=_sniff,
    read=read,
)
