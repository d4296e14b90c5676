"""Vector's text log."""

from __future__ import annotations

import re
from collections.abc import Iterator

from clutchest.can.formats.asc.writer import write
from clutchest.can.frames import Frames
from clutchest.can.log_format import LogFormat, has_line
from clutchest.can.log_source import LogSource


def read(source: LogSource) -> Iterator[Frames]:
    """The frames of such a log, block by block."""
    from clutchest.can.formats.asc import reader  # compiled functions, which take a while to load

    return reader.read(source)


_HEAD = rb"(date[ \t]|base[ \t]+(hex|dec)|begin triggerblock)"
_LINE = (  # of a piece without the head
    rb"[ \t]+\d+\.\d+[ \t]+"
    rb"(\d+[ \t]+[0-9a-f]{1,10}x?[ \t]+[rt]x[ \t]+[dr]\b|canfd[ \t]+\d+[ \t]+[rt]x[ \t])"
)

FORMAT = LogFormat(
    title=".asc",
    about="Vector: hexadecimal and decimal, stamps from the start or from line to line, CAN FD",
    suffix=".asc",
    sniff=has_line(_HEAD + b"|" + _LINE, re.IGNORECASE),
    read=read,
    lines=write,
)
