"""CRTD: ``1320745424.002 1R29 18FEF100 01 02``, of a bus (1 unless stated), received or sent.

Records of other kinds (comments, commands, events) are no frames.  Source: Open Vehicles, "CRTD CAN
log format".
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from clutchest.can.frames import Frames
from clutchest.can.log_format import LogFormat, has_line
from clutchest.can.log_source import LogSource
from clutchest.can.text_scan import (
    BAD_DATA,
    BAD_ID,
    BAD_TIME,
    BLANK,
    EXTENDED,
    FD,
    HEX,
    NO_FRAME,
    SENT,
    STATUS,
    WIDE,
    Bytes,
    Ints,
    Table,
    at_end,
    behind_line,
    blanks,
    compiled,
    decimal,
    hexadecimal,
    stamp,
    undated,
)


def read(source: LogSource) -> Iterator[Frames]:
    """Frames of such a log; lines that cannot be read are counted in ``rejected``."""
    return undated(source, _scan)


@compiled
def _scan(text: Bytes, out: Table, counts: Ints) -> int:
    """Fills the table; gives the number of frames, or -1 if a payload is wider than the table."""
    n = i = int(np.int64(0))
    while n >= 0 and i < len(text):
        end = _line(text, blanks(text, i), n, out)
        i, n = behind_line(text, i, end, n, out, counts)
    return n


@compiled
def _line(text: Bytes, i: int, n: int, out: Table) -> int:
    """Reads one line into row ``n``; the position of its newline, or why not."""
    if at_end(text, i) >= 0:
        return BLANK
    t_ns, behind = stamp(text, i, 1_000_000_000)
    if behind == i or text[behind] > 32:
        return BAD_TIME
    out.t_ns[n] = t_ns
    i = blanks(text, behind)
    bus, behind = decimal(text, i)
    bus = bus if behind > i else 1
    i, kind = behind, text[behind] & 0xDF
    if kind != 82 and kind != 84:  # R, T
        return STATUS if kind == 67 or kind == 69 else NO_FRAME  # C, E
    wide = text[i + 1] == 50 and text[i + 2] == 57  # 29
    if not wide and not (text[i + 1] == 49 and text[i + 2] == 49):  # 11
        return NO_FRAME
    i = blanks(text, i + 3)
    value, behind = hexadecimal(text, i)
    if behind == i or text[behind] > 32 or value > (0x1FFFFFFF if wide else 0x7FF):
        return BAD_ID
    out.id[n] = value
    count, i = 0, blanks(text, behind)
    while text[i] > 32:
        high, low = HEX[text[i]], HEX[text[i + 1]]
        if high < 0 or low < 0 or text[i + 2] > 32 or count == 64:
            return BAD_DATA
        if count == out.data.shape[1]:
            return WIDE
        out.data[n, count] = high * 16 + low
        count, i = count + 1, blanks(text, i + 2)
    end = at_end(text, i)
    flag = (EXTENDED if wide else 0) | (SENT if kind == 84 else 0) | (FD if count > 8 else 0)
    out.channel[n], out.flags[n], out.length[n] = max(bus - 1, 0) & 0xFF, flag, count
    return end if end >= 0 else BAD_DATA


FORMAT = LogFormat(
    title=".crtd",
    about="CRTD of Open Vehicles",
    suffix=".crtd",
    sniff=has_line(rb"[ \t]*-?\d+(\.\d+)?[ \t]+\d*[RTrt](11|29)[ \t]+[0-9A-Fa-f]{3,8}\b"),
    read=read,
)
