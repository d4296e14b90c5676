"""Vector's text log: hexadecimal or decimal, stamps from the start or from line to line, CAN FD.

``   0.100000 1  18FEF100x  Rx   d 2 FF 01`` and
``   0.100000 CANFD  1 Rx  300  Name  1 0 8 8 01 …``; a name after the id may be missing.

The date in the header, or of a ``Begin Triggerblock`` further down, makes the stamps absolute;
without a zone it is taken as local time.  Stamps that begin at the date's own time of day count
from midnight, as BusMaster has it; stamps before a trigger are negative.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from clutchest.can.formats.asc.dates import date_of
from clutchest.can.frames import LENGTHS, Frames
from clutchest.can.log_source import LogSource
from clutchest.can.text_scan import (
    BAD_DATA,
    BAD_ID,
    BAD_TIME,
    BLANK,
    BRS,
    ERROR,
    ESI,
    EXTENDED,
    FD,
    HEADER,
    NO_FRAME,
    REMOTE,
    SENT,
    WIDE,
    Bytes,
    Ints,
    Table,
    at_end,
    blanks,
    compiled,
    decimal,
    hexadecimal,
    is_word,
    line_end,
    rejected_line,
    spaced_bytes,
    stamp,
    tables,
    word,
)
from clutchest.can.time_stamps import EPOCH_NS

_DATE = re.compile(
    r"^\s*(?P<head>date|begin\s+triggerblock)\b[ \t]*(?P<words>.*)$", re.IGNORECASE | re.MULTILINE
)
_BASE = re.compile(
    r"base\s+(?P<base>hex|dec)\w*(?:\s+timestamps\s+(?P<stamps>\w+))?", re.IGNORECASE
)
_FIRST_STAMP = re.compile(r"^\s*(\d+\.\d+)\s", re.MULTILINE)
_CLOSE_S = 60.0  # s from the date's time of day in which the first frame of a log is expected
_MOST_HEADERS = 10_000  # more of them are no headers
_LONGEST_HEADER = 4096  # bytes

_DECIMAL, _DELTAS, _NOW, _START, _HEADERS = range(5)  # what a clock holds
_BEGIN, _BASE_WORD, _DATE_WORD = (np.frombuffer(w, np.uint8) for w in (b"begin", b"base", b"date"))
_END, _INTERNAL, _NO = (np.frombuffer(w, np.uint8) for w in (b"end", b"internal", b"no"))
_ERROR_FRAME, _CANFD = (np.frombuffer(w, np.uint8) for w in (b"errorframe", b"canfd"))


@dataclass(slots=True)
class _Clock:
    """The state that the header lines so far define, in the form that the compiled scan takes;
    ``by_day``: stamps count from midnight; ``notes``: what could not be read, in words."""

    now: Ints
    by_day: bool = False
    notes: tuple[str, ...] = ()

    def scan(self, text: Bytes, out: Table, counts: Ints) -> int:
        before = self.now.copy()
        n = i = 0
        while i < len(text):
            n, i = _scan(text, i, n, self.now, out, counts)
            if n < 0:
                self.now = before
                return n
            if i < len(text):
                end = int(line_end(text, i))
                self.take(text[i : min(end, i + _LONGEST_HEADER)].tobytes())
                i = end + 1
        return n

    def take(self, line: bytes) -> None:
        """A header line; one that cannot be read changes nothing."""
        self.now[_HEADERS] += 1
        words = line.decode("utf-8" if b"\xc3" in line else "latin-1", "replace").strip()
        if base := _BASE.match(words):
            self.now[_DECIMAL] = base["base"].lower() == "dec"
            self.now[_DELTAS] = (base["stamps"] or "").lower() == "relative"
        elif line_of_date := _DATE.match(words):
            self._take_date(line_of_date["words"].strip())

    def _take_date(self, words: str) -> None:
        if date := date_of(words):
            self.now[_START] = date.epoch_ns - date.since_midnight_ns * self.by_day
        elif words and not self.notes:
            self.notes = (
                f"the date {words[:60]!r} is not read, times count from the log's start: expected "
                "one such as 'Mon Nov 20 10:13:20.250 2023' or '2023-11-20 10:13:20.250'",
            )


def _counts_by_day(head: bytes) -> bool:
    """Whether the first stamp is the time of day of the date before it, as BusMaster writes it."""
    words = head.decode("latin-1")
    found = (date_of(line["words"]) for line in _DATE.finditer(words))
    date, stamp = next((date for date in found if date), None), _FIRST_STAMP.search(words)
    if date is None or stamp is None:
        return False
    begin = date.since_midnight_ns / 1e9
    return begin > _CLOSE_S and -1.0 <= float(stamp[1]) - begin <= _CLOSE_S


def read(source: LogSource) -> Iterator[Frames]:
    """Frames of an asc log; lines that cannot be read are counted in ``rejected``."""
    clock = _Clock(np.zeros(5, np.int64), _counts_by_day(source.head))
    for frames in tables(source, clock.scan):
        absolute = bool(clock.now[_START] >= EPOCH_NS)
        yield replace(frames, absolute=absolute, notes=clock.notes)


@compiled
def _scan(text: Bytes, i: int, n: int, now: Ints, out: Table, counts: Ints) -> tuple[int, int]:
    """Fills the table from row ``n`` on; stops at the end or at the next header line.

    Gives the number of frames, or -1 if a payload is wider than the table, and the position.
    """
    while i < len(text):
        end = _line(text, blanks(text, i), n, now, out)
        if end >= 0:
            n += 1
            i = end + 1
        elif end == HEADER:
            return n, i
        elif end == WIDE:
            return -1, i
        else:
            i = rejected_line(text, i, end, n, out, counts)
    return n, i


@compiled
def _line(text: Bytes, i: int, n: int, now: Ints, out: Table) -> int:
    """Reads one line into row ``n``; the position of its newline, or why not."""
    if (text[i] < 48 or text[i] > 57) and text[i] != 45:  # -, before the trigger
        if is_word(text, i, _BEGIN) or is_word(text, i, _BASE_WORD) or is_word(text, i, _DATE_WORD):
            return HEADER if now[_HEADERS] < _MOST_HEADERS else NO_FRAME
        idle = text[i] == 47 or text[i] == 59 or at_end(text, i) >= 0  # comments
        for mark in (_END, _INTERNAL, _NO):
            idle |= is_word(text, i, mark)
        return BLANK if idle else NO_FRAME
    t_ns, behind = stamp(text, i, 1_000_000_000)
    if behind == i or text[behind] > 32:
        return BAD_TIME
    if now[_DELTAS]:
        t_ns = now[_NOW] + t_ns
        now[_NOW] = t_ns
    out.t_ns[n] = now[_START] + t_ns
    base = 10 if now[_DECIMAL] else 16
    i = blanks(text, behind)
    if is_word(text, i, _CANFD):
        return _fd(text, blanks(text, i + 5), n, base, out)
    channel, behind = decimal(text, i)
    if behind == i or text[behind] > 32:
        return BLANK if (text[i] | 32) == 115 else NO_FRAME  # Start of measurement
    out.channel[n] = max(channel - 1, 0) & 0xFF
    return _classic(text, blanks(text, behind), n, base, out)


@compiled
def _number(text: Bytes, i: int, base: int) -> tuple[int, int]:
    return hexadecimal(text, i) if base == 16 else decimal(text, i)


@compiled
def _id(text: Bytes, i: int, n: int, base: int, out: Table) -> tuple[int, int]:
    """(flags, position behind) of an id, (-1, …) if it is none."""
    value, behind = _number(text, i, base)
    flag = 0
    if (text[behind] | 32) == 120 and behind > i:  # x
        flag = EXTENDED
        behind += 1
    if behind == i or text[behind] > 32 or value > 0x1FFFFFFF:
        return -1, i
    out.id[n] = value
    return flag, behind


@compiled
def _error(text: Bytes, i: int, n: int, flag: int, out: Table) -> int:
    out.id[n], out.flags[n], out.length[n] = 0, flag | ERROR, 0
    return line_end(text, i)


@compiled
def _direction(text: Bytes, i: int) -> int:
    """Flags that Rx, Tx or TxRq stand for, -1 for another word."""
    if (text[i + 1] | 32) != 120:
        return -1
    return 0 if (text[i] | 32) == 114 else SENT if (text[i] | 32) == 116 else -1


@compiled
def _classic(text: Bytes, i: int, n: int, base: int, out: Table) -> int:
    if is_word(text, i, _ERROR_FRAME):
        return _error(text, i, n, 0, out)
    identified = i
    i = blanks(text, word(text, i))
    sent = _direction(text, i) if text[i] > 32 else -1
    if sent < 0:
        return NO_FRAME  # statistics and the like
    flag, behind = _id(text, identified, n, base, out)
    if flag < 0:
        return BAD_ID
    flag |= sent
    i = blanks(text, word(text, i))
    kind = text[i] | 32
    if (kind != 100 and kind != 114) or text[i + 1] > 32:  # d, r
        return BAD_DATA
    i = blanks(text, i + 1)
    count, behind = _number(text, i, base)
    if behind > i and text[behind] <= 32:
        if count > 15:
            return BAD_DATA
        count = min(LENGTHS[count], 8)
        i = behind
    elif kind == 100:
        return BAD_DATA
    else:
        count = 0  # older files have no length of remote frames
    if kind == 100:
        i = spaced_bytes(text, i, count, base, out, n)
        if i < 0:
            return i
    else:
        flag |= REMOTE
    out.flags[n], out.length[n] = flag, count
    return line_end(text, i)


@compiled
def _fd(text: Bytes, i: int, n: int, base: int, out: Table) -> int:
    channel, behind = decimal(text, i)
    if behind == i or text[behind] > 32:
        return NO_FRAME
    out.channel[n] = max(channel - 1, 0) & 0xFF
    i = blanks(text, behind)
    sent = _direction(text, i) if text[i] > 32 else -1
    old = sent < 0  # id and direction, then "d" or "r" behind the bits
    if not old:
        i = blanks(text, word(text, i))
    if is_word(text, i, _ERROR_FRAME):
        return _error(text, i, n, FD | max(sent, 0), out)
    flag, behind = _id(text, i, n, base, out)
    i = blanks(text, word(text, i))
    if old:
        sent = _direction(text, i) if text[i] > 32 else -1
        if sent < 0:
            return NO_FRAME
        i = blanks(text, word(text, i))
    elif (text[i] != 48 and text[i] != 49) or text[i + 1] > 32:
        i = blanks(text, word(text, i))  # the name of the message
    if flag < 0:
        return BAD_ID
    flag |= FD | sent
    for bit in (BRS, ESI):
        if (text[i] != 48 and text[i] != 49) or text[i + 1] > 32:
            return BAD_DATA
        if text[i] == 49:
            flag |= bit
        i = blanks(text, i + 1)
    kind = text[i] | 32 if old else 100
    if old:
        if (kind != 100 and kind != 114) or text[i + 1] > 32:  # d, r
            return BAD_DATA
        i = blanks(text, i + 1)
    code, behind = _number(text, i, base)
    if behind == i or text[behind] > 32 or code > 15:
        return BAD_DATA
    if kind == 114:  # CAN FD has no remote frames
        out.flags[n] = (flag & ~(FD | BRS | ESI)) | REMOTE
        out.length[n] = min(LENGTHS[code], 8)
        return line_end(text, behind)
    i = blanks(text, behind)
    count, behind = decimal(text, i)
    if behind == i or text[behind] > 32 or count > 64:
        return BAD_DATA
    if count == 0 and code > 0:
        flag |= REMOTE
        count = LENGTHS[code]
    else:
        behind = spaced_bytes(text, behind, count, base, out, n)
        if behind < 0:
            return behind
    out.flags[n], out.length[n] = flag, count
    return line_end(text, behind)
