"""Vehicle Spy's csv: ``Line,Abs Time(Sec),Rel Time (Sec),Status,Er,Tx,Description,Network,…``."""

from __future__ import annotations

from collections.abc import Iterator

from clutchest.can import csv_frames
from clutchest.can.frames import Frames
from clutchest.can.log_format import LogFormat
from clutchest.can.log_source import LogSource


def _header(head: bytes) -> csv_frames.Header | None:
    for header in csv_frames.headers(head):
        if {"Arb ID", "Xtd", "B1"} <= set(header.names) and header.holds_frames():
            return header
    return None


def _sniff(head: bytes) -> int | None:
    header = _header(head) if b"Arb ID" in head else None
    return None if header is None else header.begin


def read(source: LogSource) -> Iterator[Frames]:
    """Frames of such a log; lines that cannot be read are counted in ``rejected``."""
    header = _header(source.head)
    assert header is not None
    return csv_frames.frames_of(source, header, 1_000_000_000)


FORMAT = LogFormat(
    title="Vehicle Spy csv",
    about="Vehicle Spy's, a byte in each column",
    suffix=".csv",
    sniff=_sniff,
    read=read,
)
