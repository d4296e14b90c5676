"""Frames in tables of text whose header names the columns: the common part of such formats.

A format finds its header in the head of a file, and says how times and ids are written.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

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
    HEX,
    NO_FRAME,
    REMOTE,
    SENT,
    TOO_SHORT,
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
    line_end,
    undated,
)
from clutchest.errors import ClutchestError

SKIP, TIME, ID, CHANNEL, LENGTH, DATA, BYTE = range(7)
IS_EXTENDED, IS_REMOTE, IS_ERROR, IS_SENT, IS_FD, IS_FAST, IS_PASSIVE = range(7, 14)
_NAMED = {
    TIME: r"time|timestamps?|abstime(sec)?|times|timems|timeus",
    ID: r"id|canid|arbid|arbitrationid|identifier|addr|address|messageid|msgid|idhex|iddec",
    IS_EXTENDED: r"extended|xtd|ext|ide|extendedid",
    IS_REMOTE: r"remote|rtr|remoteframe",
    IS_ERROR: r"er|err|error|errorframe",
    IS_SENT: r"dir|direction|tx|rxtx|txrx",
    IS_FD: r"edl|fdf|fd|canfd",
    IS_FAST: r"brs",
    IS_PASSIVE: r"esi",
    CHANNEL: r"bus|buschannel|channel|chn|ch|network|canchannel|busnumber",
    LENGTH: r"len|length|datalength|dlc|size|datalen",
    DATA: r"data|databytes|payload|datahex",
    BYTE: r"[db]\d+|data\d+|byte\d+|databyte\d+",
}
_UNITS = {"ms": 1_000_000, "us": 1_000, "µs": 1_000, "ns": 1}
_DATE = re.compile(r"\d{4}[-/.]\d\d?[-/.]\d|\d[-/.]\d\d?[-/.]\d{4}|\d:\d\d(:\d\d)?")
_HEADER_LINES = 100  # of the file, among which the header is


class Layout(NamedTuple):
    """``roles`` (c,) of the columns; the ``separator``; the ``time_ns`` of a unit of time, whether
    ids are ``decimal``, payloads too (``listed``, such as ``[1 255]``), channels count from
    ``first_channel``, and numbers have a ``comma``."""

    roles: NDArray[np.uint8]
    separator: int
    time_ns: int
    decimal: bool
    listed: bool
    first_channel: int
    comma: bool


@dataclass(frozen=True, slots=True)
class Header:
    """The header of such a file: where it ``begins`` and ends in the head, and its names."""

    begin: int
    end: int
    names: tuple[str, ...]
    separator: str

    def roles(self) -> list[int]:
        """The role of each column; of several lengths the one that is no code counts."""
        roles = [_role(name) for name in self.names]
        lengths = [k for k, role in enumerate(roles) if role == LENGTH]
        for k in lengths[1:] if len(lengths) > 1 else ():
            code = _plain(self.names[lengths[0]]) == "dlc"
            roles[lengths[0] if code else k] = SKIP
        for once in (TIME, ID, DATA, CHANNEL, IS_SENT):
            for k in [k for k, role in enumerate(roles) if role == once][1:]:
                roles[k] = SKIP
        return roles

    def holds_frames(self) -> bool:
        """Whether it names time, id and data."""
        roles = self.roles()
        return TIME in roles and ID in roles and (DATA in roles or roles.count(BYTE) > 1)

    def unit_ns(self) -> int:
        """ns of the unit that the column of times states; s without one."""
        stated = next((n for n in self.names if _role(n) == TIME), "").lower()
        unit = re.search(r"[\[(]\s*(ms|us|µs|ns)\s*[\])]|(ms|us)$", stated)
        return _UNITS[unit[1] or unit[2]] if unit else 1_000_000_000


def _plain(name: str) -> str:
    return re.sub(r"\(.*?\)|\[[a-zµ]*\]|[^a-z0-9]", "", name.lower())


def _role(name: str) -> int:
    plain = _plain(name)
    return next((r for r, named in _NAMED.items() if re.fullmatch(named, plain)), SKIP)


def headers(head: bytes) -> Iterator[Header]:
    """The first lines of a file as headers, wherever they may be one."""
    begin = 0
    for line in head.split(b"\n")[:_HEADER_LINES]:
        end = begin + len(line) + 1
        text = line.decode("utf-8", "replace").strip()
        separator = max(",;\t", key=text.count)
        if text.count(separator) >= 2:
            names = tuple(name.strip().strip('"') for name in text.split(separator))
            yield Header(begin, end, names, separator)
        begin = end


def header_of(source: LogSource, wanted: Callable[[Header], bool]) -> Header:
    """The first ``wanted`` header of a file.  Raises ClutchestError where there is none: what only
    looked like one may be cut where a format looked, or have more of another separator."""
    for header in headers(source.head):
        if wanted(header):
            return header
    raise ClutchestError(f"{source.path}: expected one line that names time, id and data bytes")


def frames_of(
    source: LogSource,
    header: Header,
    time_ns: int,
    *,
    first_channel: int = 0,
    listed: bool = False,
) -> Iterator[Frames]:
    """Frames behind the ``header``; lines that cannot be read are counted in ``rejected``.

    ``listed``: ids and payloads are decimal, and these in brackets.
    """
    dec = listed or any(_role(name) == ID and "dec" in name.lower() for name in header.names)
    sample = source.head[header.end :].split(b"\n")[0]
    _check_times(source, header, sample)
    layout = Layout(
        np.array(header.roles(), np.uint8),
        ord(header.separator),
        time_ns,
        dec,
        listed,
        first_channel,
        header.separator == ";" and b"." not in sample.split(b";")[0],
    )
    source.read(header.end)
    return undated(source, lambda *table: _scan(layout, *table))


def _check_times(source: LogSource, header: Header, sample: bytes) -> None:
    """Raises ClutchestError where the first line of frames has a date for a time."""
    cells = sample.decode("utf-8", "replace").split(header.separator)
    for role, cell in zip(header.roles(), cells, strict=False):
        if role == TIME and _DATE.search(cell):
            raise ClutchestError(
                f"{source.path}: the time of a frame is {cell.strip()[:40]!r}; expected a csv of "
                "frames with numbers of s, ms, µs or ns"
            )


@compiled
def _scan(layout: Layout, text: Bytes, out: Table, counts: Ints) -> int:
    """Fills the table; gives the number of frames, or -1 if a payload is wider than the table."""
    n = i = int(np.int64(0))
    while n >= 0 and i < len(text):
        end = _line(layout, text, i, n, out)
        i, n = behind_line(text, i, end, n, out, counts)
    return n


@compiled
def _line(layout: Layout, text: Bytes, i: int, n: int, out: Table) -> int:
    """Reads one line into row ``n``; the position of its newline, or why not."""
    if at_end(text, i) >= 0:
        return BLANK
    flag = count = channel = 0
    stated, known, extended = -1, 0, False
    column, columns = 0, len(layout.roles)
    while column < columns or layout.roles[columns - 1] == BYTE:  # a header may name 8 of 64 bytes
        role = layout.roles[min(column, columns - 1)]
        column += 1
        i = blanks(text, i) if layout.separator != 9 else i
        quoted = text[i] == 34
        i += quoted
        behind = i
        if role == TIME:
            t_ns, behind = _time(text, i, layout.time_ns, layout.comma)
            ends = text[behind] == layout.separator or (text[behind] <= 34 and not layout.listed)
            if behind == i or not ends:  # a date, or the rest of a list
                return BAD_TIME
            out.t_ns[n] = t_ns
        elif role == ID:
            value, behind = _id(text, i, layout.decimal)
            if behind == i or value > 0x1FFFFFFF:
                return BAD_ID
            out.id[n] = value
            extended |= value > 0x7FF or (text[behind] | 32) == 120
            known += 1
        elif role == LENGTH:
            stated, behind = decimal(text, i)
            if behind == i or stated > 64:
                stated = -1
        elif role == CHANNEL:
            channel = _channel(text, i, layout.separator) - layout.first_channel
        elif role in (DATA, BYTE):
            count, behind = _payload(layout.listed, text, i, count, role == DATA, n, out)
            if count < 0:
                return count
        elif role != SKIP and (text[i] | 32 == 116 or text[i] == 49 or text[i] | 32 == 121):
            flag |= _flag_of(role)
        i = _field_end(text, behind, layout.separator, quoted)
        if text[i] == 10:
            break
        i += 1
    if not known:
        return NO_FRAME
    if extended:
        flag |= EXTENDED
    if flag & ERROR:
        flag &= ~EXTENDED
    length = _length(stated, count, flag)
    if length > count and not flag & (REMOTE | ERROR):
        return TOO_SHORT
    for byte in range(0 if flag & REMOTE else length, count):
        out.data[n, byte] = 0
    if length > 8:
        flag |= FD
    out.channel[n], out.flags[n], out.length[n] = max(channel, 0) & 0xFF, flag, length
    return line_end(text, i)


@compiled
def _flag_of(role: int) -> int:
    """The flag that a column of yes or no sets."""
    if role == IS_EXTENDED:
        return EXTENDED
    if role == IS_REMOTE:
        return REMOTE
    if role == IS_FD:
        return FD
    if role == IS_FAST:
        return BRS
    if role == IS_PASSIVE:
        return ESI
    return ERROR if role == IS_ERROR else SENT


@compiled
def _length(stated: int, count: int, flag: int) -> int:
    """Payload bytes, of what is stated and how many there are: beyond 8 a code may be stated."""
    if stated < 0:
        return count
    if 8 < stated < 16 and LENGTHS[stated] == count:
        return count
    return stated


@compiled
def _field_end(text: Bytes, i: int, separator: int, quoted: bool) -> int:
    """The separator or newline behind a field."""
    while text[i] != 10 and (quoted or text[i] != separator):
        quoted = quoted and text[i] != 34
        i += 1
    return i


@compiled
def _time(text: Bytes, i: int, unit_ns: int, comma: bool) -> tuple[int, int]:
    """(ns, position behind) of a decimal number in ``unit_ns``."""
    first = i + 1 if text[i] == 45 else i  # -
    whole, behind = decimal(text, first)
    if behind == first or whole > 9_000_000_000_000_000_000 // unit_ns:
        return 0, i
    ns = whole * unit_ns
    if text[behind] == 46 or (comma and text[behind] == 44):
        behind += 1
        while 48 <= text[behind] <= 57:
            unit_ns //= 10
            ns += (text[behind] - 48) * unit_ns
            behind += 1
    return (-ns if first > i else ns), behind


@compiled
def _id(text: Bytes, i: int, is_decimal: bool) -> tuple[int, int]:
    """(id, position behind), hexadecimal unless ``is_decimal``, with or without 0x."""
    if text[i] == 48 and (text[i + 1] | 32) == 120:
        value, behind = hexadecimal(text, i + 2)
        return value, (i if behind == i + 2 else behind)
    if is_decimal:
        return decimal(text, i)
    return hexadecimal(text, i)


@compiled
def _channel(text: Bytes, i: int, separator: int) -> int:
    """The first number in a field."""
    while text[i] != 10 and text[i] != separator:
        if 48 <= text[i] <= 57:
            value, _ = decimal(text, i)
            return value
        i += 1
    return 0


@compiled
def _payload(
    listed: bool, text: Bytes, i: int, count: int, many: bool, n: int, out: Table
) -> tuple[int, int]:
    """As :func:`_listed` or :func:`_bytes`."""
    return _listed(text, i, n, out) if listed else _bytes(text, i, count, many, n, out)


@compiled
def _bytes(text: Bytes, i: int, count: int, many: bool, n: int, out: Table) -> tuple[int, int]:
    """(bytes so far, position behind) of one byte or, where there are ``many``, of a field of them,
    with or without blanks between; a negative number is the reason why not."""
    while True:
        while many and (text[i] == 32 or text[i] == 45):
            i += 1
        if text[i] == 48 and (text[i + 1] | 32) == 120:  # 0x
            i += 2
        high = HEX[text[i]]
        if high < 0:
            return count, i
        low = HEX[text[i + 1]]
        if count == 64:
            return BAD_DATA, i
        if count == out.data.shape[1]:
            return WIDE, i
        out.data[n, count] = high if low < 0 else high * 16 + low
        count, i = count + 1, i + (1 if low < 0 else 2)
        if not many:
            return count, i


@compiled
def _listed(text: Bytes, i: int, n: int, out: Table) -> tuple[int, int]:
    """(bytes, position behind) of decimal numbers in brackets; a negative number is the reason why
    not."""
    count = 0
    if text[i] != 91:  # [
        return BAD_DATA, i
    i = blanks(text, i + 1)
    while text[i] != 93:  # ]
        value, behind = decimal(text, i)
        if behind == i or value > 255 or count == 64:
            return BAD_DATA, i
        if count == out.data.shape[1]:
            return WIDE, i
        out.data[n, count] = value
        count, i = count + 1, blanks(text, behind)
    return count, i + 1
