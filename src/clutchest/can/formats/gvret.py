"""SavvyCAN's own csv, which GVRET devices write too: ``Time Stamp,ID,Extended,Dir,Bus,LEN,D1,…``.

Stamps are in µs, ids and bytes hexadecimal; older versions have no direction.
"""

from __future__ import annotations

from collections.abc import Iterator

from clutchest.can.csv_frames import frames_of
from clutchest.can.csv_header import header_of
from clutchest.can.frames import Frames
from clutchest.can.log_format import LogFormat, has_line
from clutchest.can.log_source import LogSource

_HEADER = rb"Time ?Stamp,ID,Extended,"


def read(source: LogSource) -> Iterator[Frames]:
    """Frames of such a log; lines that cannot be read are counted in ``rejected``."""
    header = header_of(source, lambda h: h.names[1:3] == ("ID", "Extended"))
    return frames_of(source, header, 1_000, first_channel=0, decimal_ids=False)


FORMAT = LogFormat(
    title="SavvyCAN csv",
    about="SavvyCAN's and GVRET's, stamps in µs",
    suffix=".csv",
    sniff=has_line(_HEADER),
    read=read,
)
