"""CSV that asammdf exports of an MDF file's bus logging, a line for each frame:
``0.5,1,419356416,1,8,8,[132 255 3 4 5 6 7 8],0,0,0,0``.

Where a group holds CAN FD its payloads go over several lines, which is refused.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from clutchest.can import csv_frames
from clutchest.can.frames import Frames
from clutchest.can.log_format import LogFormat, has_line
from clutchest.can.log_source import LogSource
from clutchest.errors import ClutchestError

_CHANNELS = rb'[^\n]{0,200}\btimestamps"?[,;\t][^\n]*\bCAN_DataFrame\.ID\b'


def _named(header: csv_frames.Header) -> csv_frames.Header:
    """The header with the last part of each channel's name."""
    return replace(header, names=tuple(name.rpartition(".")[2] for name in header.names))


def read(source: LogSource) -> Iterator[Frames]:
    """Frames of such an export; lines that cannot be read are counted in ``rejected``.

    Raises ClutchestError for payloads that go over several lines.
    """
    header = csv_frames.header_of(source, lambda each: _named(each).holds_frames())
    first = source.head[header.end :].split(b"\n")[0]
    if b"[" in first and b"]" not in first:
        raise ClutchestError(
            f"{source.path}: asammdf's csv of CAN FD, whose payloads go over several lines; "
            "expected the MDF file itself"
        )
    return csv_frames.frames_of(source, _named(header), 10**9, listed=True)


FORMAT = LogFormat(
    title="csv of asammdf",
    about="asammdf's export of bus logging without CAN FD",
    suffix=".csv",
    sniff=has_line(_CHANNELS),
    read=read,
)
