"""Vehicle Spy's csv: ``Line,Abs Time(Sec),Rel Time (Sec),Status,Er,Tx,Description,Network,…``."""

from __future__ import annotations

from collections.abc import Iterator

from clutchest.can.csv_frames import frames_of
from clutchest.can.csv_header import Header, header_of, headers
from clutchest.can.frames import Frames
from clutchest.can.log_format import LogFormat
from clutchest.can.log_source import LogSource


def _is_own(header: Header) -> bool:
    return {"Arb ID", "Xtd", "B1"} <= set(header.names) and header.holds_frames()


def _sniff(head: bytes) -> int | None:
    if b"Arb ID" not in head:
        return None
    return next((h.begin for h in headers(head) if _is_own(h)), None)


def read(source: LogSource) -> Iterator[Frames]:
    """Frames of such a log; lines that cannot be read are counted in ``rejected``."""
    header = header_of(source, _is_own)
    return frames_of(source, header, 1_000_000_000, first_channel=0, decimal_ids=False)


FORMAT = LogFormat(
    title="Vehicle Spy csv",
    about="Vehicle Spy's, a byte in each column",
    suffix=".csv",
    sniff=_sniff,
    read=read,
)
