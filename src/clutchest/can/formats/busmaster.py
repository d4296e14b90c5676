"""BusMaster's log: ``11:21:14:8082 Rx 1 0x122 s 8 E3 0C …``, times in units of 0.1 ms.

Its head states the date, whether numbers are hexadecimal, and whether times are those of the clock,
from the start or from the line before.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from datetime import datetime

import numpy as np

from clutchest.can.frames import LENGTHS, Frames
from clutchest.can.log_format import LogFormat, has_line
from clutchest.can.log_source import LogSource
from clutchest.can.text_scan import (
    BAD_DATA,
    BAD_ID,
    BAD_TIME,
    BLANK,
    ERROR,
    EXTENDED,
    FD,
    NO_FRAME,
    REMOTE,
    SENT,
    Bytes,
    Ints,
    Table,
    at_end,
    behind_line,
    blanks,
    compiled,
    decimal,
    hexadecimal,
    line_end,
    spaced_bytes,
    tables,
)
from clutchest.can.text_times import past_midnight
from clutchest.can.time_stamps import LAST_S

_START = re.compile(
    rb"\*\*\*START DATE AND TIME (\d+):(\d+):(\d+) (\d+):(\d+):(\d+)(?::(\d+))?", re.IGNORECASE
)
_STATED = re.compile(rb"\*\*\*START DATE AND TIME ([^*\r\n]+)", re.IGNORECASE)
_DECIMAL = re.compile(rb"^\*\*\*DEC\*\*\*", re.MULTILINE)
_MODE = re.compile(rb"^\*\*\*(SYSTEM|ABSOLUTE|RELATIVE) MODE\*\*\*", re.MULTILINE)


def read(source: LogSource) -> Iterator[Frames]:
    """Frames of such a log; lines that cannot be read are counted in ``rejected``."""
    mode = _MODE.search(source.head)
    kind = mode[1] if mode else b"SYSTEM"
    start = _start(source.head)
    base = 10 if _DECIMAL.search(source.head) else 16
    notes: tuple[str, ...] = ()
    if start is None and (stated := _STATED.search(source.head)):
        words = stated[1].decode("latin-1").strip()[:60]
        notes = (f"the date {words!r} is not read, times are without a date",)
    offset = 0 if start is None else _midnight_ns(start) if kind == b"SYSTEM" else _ns(start)
    last = np.int64(0)
    for frames in tables(source, lambda *table: _scan(base, *table)):
        relative = kind == b"RELATIVE"
        t_ns = last + np.cumsum(frames.t_ns) if relative else past_midnight(frames.t_ns, int(last))
        last = t_ns[-1] if len(t_ns) else last
        yield replace(frames, t_ns=t_ns + offset, absolute=start is not None, notes=notes)


def _start(head: bytes) -> datetime | None:
    """The date in the head, of this machine's zone."""
    found = _START.search(head)
    if not found:
        return None
    day, month, year, hour, minute, second, ms = (int(part or 0) for part in found.groups())
    try:
        date = datetime(year, month, day, hour, minute, second, ms % 1000 * 1000).astimezone()
    except (ValueError, OverflowError, OSError):
        return None
    return date if 0 < date.timestamp() < LAST_S else None


def _ns(moment: datetime) -> int:
    return round(moment.timestamp() * 1e6) * 1000


def _midnight_ns(moment: datetime) -> int:
    return _ns(moment.replace(hour=0, minute=0, second=0, microsecond=0, tzinfo=None).astimezone())


@compiled
def _scan(base: int, text: Bytes, out: Table, counts: Ints) -> int:
    """Fills the table; gives the number of frames, or -1 if a payload is wider than the table."""
    n = i = int(np.int64(0))
    while n >= 0 and i < len(text):
        end = _line(text, blanks(text, i), base, n, out)
        i, n = behind_line(text, i, end, n, out, counts)
    return n


@compiled
def _line(text: Bytes, i: int, base: int, n: int, out: Table) -> int:
    """Reads one line into row ``n``; the position of its newline, or why not."""
    if text[i] == 42 or at_end(text, i) >= 0:  # *
        return BLANK
    t_ns, behind = _clock(text, i)
    if behind == i:
        return BAD_TIME
    out.t_ns[n] = t_ns
    i = blanks(text, behind)
    flag = SENT if (text[i] | 32) == 116 else 0
    if text[i] <= 32 or (text[i + 1] | 32) != 120:  # Rx, Tx
        return NO_FRAME
    channel, behind = decimal(text, blanks(text, i + 2))
    i = blanks(text, behind)
    if (text[i] | 32) == 101 and (text[i + 1] | 32) == 114:  # an error
        out.id[n] = 0
        out.channel[n], out.flags[n], out.length[n] = max(channel - 1, 0) & 0xFF, ERROR, 0
        return line_end(text, i)
    if base == 16:
        i += 2 if text[i] == 48 and (text[i + 1] | 32) == 120 else 0  # 0x
        value, behind = hexadecimal(text, i)
    else:
        value, behind = decimal(text, i)
    if behind == i or text[behind] > 32 or value > 0x1FFFFFFF:
        return BAD_ID
    out.id[n] = value
    i = blanks(text, behind)
    if (text[i] | 32) != 115 and (text[i] | 32) != 120:  # s, x
        return NO_FRAME
    while text[i] > 32:
        letter = text[i] | 32
        flag |= (
            EXTENDED if letter == 120 else REMOTE if letter == 114 else FD if letter == 102 else 0
        )
        i += 1
    count, behind = decimal(text, blanks(text, i))
    if behind == blanks(text, i) or text[behind] > 32 or count > 64:
        return BAD_DATA
    if flag & FD and 8 < count < 16:
        count = LENGTHS[count]
    if count > 8:
        flag |= FD
    if not flag & REMOTE:
        behind = spaced_bytes(text, behind, count, base, out, n)
        if behind < 0:
            return behind
    out.channel[n], out.flags[n], out.length[n] = max(channel - 1, 0) & 0xFF, flag, count
    return line_end(text, behind)


@compiled
def _clock(text: Bytes, i: int) -> tuple[int, int]:
    """(ns, position behind) of ``11:21:14:8082``, the position itself where there is none."""
    ns, unit, k = 0, 3_600_000_000_000, i
    for part in range(4):
        value, behind = decimal(text, k)
        if behind == k or value > 999_999:
            return 0, i
        if part < 3:
            if text[behind] != 58:
                return 0, i
            ns += value * unit
            unit //= 60
            k = behind + 1
        else:
            digits = behind - k
            for _ in range(9 - digits):
                value *= 10
            ns += value
            k = behind
    return (ns, k) if text[k] <= 32 else (0, i)


FORMAT = LogFormat(
    title="BusMaster log",
    about="BusMaster's, times of the clock, from the start or from line to line",
    suffix=".log",
    sniff=has_line(rb"\*\*\*BUSMASTER Ver"),
    read=read,
)
