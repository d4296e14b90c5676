"""SavvyCAN's own csv, which GVRET devices write too: ``Time Stamp,ID,Extended,Dir,Bus,LEN,D1,…``.

Stamps are in µs, ids and bytes hexadecimal; older versions have no direction.
"""

from __future__ import annotations

from collections.abc import Iterator

from clutchest.can.csv_frames import frames_of
from clutchest.can.csv_header import Header, header_of, headers
from clutchest.can.frames import Frames
from clutchest.can.log_format import LogFormat
from clutchest.can.log_source import LogSource


def _is_own(header: Header) -> bool:
    first, *others = header.names[:3]
    return first in ("Time Stamp", "TimeStamp") and others == ["ID", "Extended"]


def _sniff(head: bytes) -> int | None:
    if b"Extended" not in head:
        return None
    return next((h.begin for h in headers(head) if _is_own(h)), None)


def read(source: LogSource) -> Iterator[Frames]:
    """Frames of such a log; lines that cannot be read are counted in ``rejected``."""
    header = header_of(source, _is_own)
    return frames_of(source, header, 1_000, first_channel=0, decimal_ids=False)


FORMAT = LogFormat(
    title="SavvyCAN csv",
    about="SavvyCAN's and GVRET's, stamps in µs",
    suffix=".csv",
    sniff=_sniff,
    read=read,
)
