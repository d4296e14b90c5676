"""Vehicle Spy's csv: ``Line,Abs Time(Sec),Rel Time (Sec),Status,Er,Tx,Description,Network,…``."""

from __future__ import annotations

from collections.abc import Iterator

from clutchest.can import csv_frames
from clutchest.can.frames import Frames
from clutchest.can.log_format import LogFormat
from clutchest.can.log_source import LogSource


def _is_own(header: csv_frames.Header) -> bool:
    return {"Arb ID", "Xtd", "B1"} <= set(header.names) and header.holds_frames()


def _sniff(head: bytes) -> int | None:
    if b"Arb ID" not in head:
        return None
    return next((h.begin for h in csv_frames.headers(head) if _is_own(h)), None)


def read(source: LogSource) -> Iterator[Frames]:
    """Frames of such a log; lines that cannot be read are counted in ``rejected``."""
    header = csv_frames.header_of(source, _is_own)
    return csv_frames.frames_of(source, header, 1_000_000_000)


FORMAT = LogFormat(
    title="Vehicle Spy csv",
    about="Vehicle Spy's, a byte in each column",
    suffix=".csv",
    sniff=_sniff,
    read=read,
)
