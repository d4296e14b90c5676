"""CSV that asammdf exports of an MDF file's bus logging: a line for each frame, of CAN FD several:
``0.5,1,419356416,1,8,8,[132 255 3 4 5 6 7 8],0,0,0,0``.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from clutchest.can.csv_frames import frames_of
from clutchest.can.csv_header import Header, header_of
from clutchest.can.frames import Frames
from clutchest.can.log_format import LogFormat, has_line
from clutchest.can.log_source import LogSource

_CHANNELS = rb'[^\n]{0,200}\btimestamps"?[,;\t][^\n]*\bCAN_DataFrame\.ID\b'


def _named(header: Header) -> Header:
    """The header with the last part of each channel's name."""
    return replace(header, names=tuple(name.rpartition(".")[2] for name in header.names))


def read(source: LogSource) -> Iterator[Frames]:
    """Frames of such an export; lines that cannot be read are counted in ``rejected``."""
    header = header_of(source, lambda each: _named(each).holds_frames())
    return frames_of(source, _named(header), first_channel=0, decimal_ids=True)


FORMAT = LogFormat(
    title="csv of asammdf",
    about="asammdf's export of bus logging",
    suffix=".csv",
    sniff=has_line(_CHANNELS),
    read=read,
)
