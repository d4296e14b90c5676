"""Vector's text log."""

from __future__ import annotations

import re

from clutchest.can.formats.asc.reader import read
from clutchest.can.formats.asc.writer import write
from clutchest.can.log_format import LogFormat, has_line

FORMAT = LogFormat(
    title=".asc",
    about="Vector: hexadecimal and decimal, stamps from the start or from line to line, CAN FD",
    suffix=".asc",
    sniff=has_line(rb"(date[ \t]|base[ \t]+(hex|dec)|begin triggerblock)", re.IGNORECASE),
    read=read,
    lines=write,
)
