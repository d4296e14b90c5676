"""Frames in tables of text whose header names the columns: the common part of such formats.

A format finds its header in the head of a file, and says how times and ids are written.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from clutchest.can.csv_cells import (
    cell_ends,
    channel_number,
    decimal_payload,
    field_end,
    flags_of,
    flags_of_kvaser,
    frame_length,
    identifier,
    is_letter,
    payload,
)
from clutchest.can.csv_header import (
    BITS,
    BYTE,
    CHANNEL,
    DATA,
    ID,
    LENGTH,
    SKIP,
    TIME,
    FirstRows,
    Header,
)
from clutchest.can.frames import Frames
from clutchest.can.log_source import LogSource
from clutchest.can.text_scan import (
    BAD_ID,
    BAD_TIME,
    BLANK,
    ERROR,
    EXTENDED,
    FD,
    NO_FRAME,
    REMOTE,
    TOO_SHORT,
    Bytes,
    Ints,
    Table,
    at_end,
    behind_line,
    blanks,
    compiled,
    decimal,
    line_end,
    undated,
)
from clutchest.can.text_times import clock_ns, date_ns, from_local, number_ns, past_midnight
from clutchest.errors import ClutchestError

KINDS = {"number": 0, "date": 1, "clock": 2}  # of times
_NUMBERS, _DATES, _CLOCKS = KINDS.values()
_FLAGS, _COUNT, _CHANNEL, _STATED, _KNOWN, _FILLED, _ROW = range(7)  # of a row, while it is read
_LONGEST = 2_000  # bytes from a bracket to the next one


class Layout(NamedTuple):
    """``roles`` (c,) of the columns; the ``separator``; the ``time_kind`` and the ``time_ns`` of a
    unit of time; whether ids and bytes are decimal; the number of the first channel."""

    roles: NDArray[np.uint8]
    separator: int
    time_kind: int
    time_ns: int
    decimal_ids: bool
    decimal_data: bool
    first_channel: int


def frames_of(
    source: LogSource,
    header: Header,
    time_ns: int = 0,
    *,
    first_channel: int | None = None,
    decimal_ids: bool | None = None,
    decimal_data: bool | None = None,
) -> Iterator[Frames]:
    """Frames behind the ``header``; lines that cannot be read are counted in ``rejected``.

    What is not given is read from the header and the first rows.  Raises ClutchestError for times
    that are neither numbers nor dates nor those of a clock.
    """
    first = FirstRows.of(source.head, header)
    kind, zoned = first.time_kind()
    if kind not in KINDS:
        raise ClutchestError(
            f"{source.path}: the time of a frame is {kind[:40]!r}; expected numbers of s, ms, µs "
            "or ns, dates such as 2024-02-29T23:59:59.5, or 23:59:59.5"
        )
    notes: tuple[str, ...] = ()
    if decimal_ids is None:
        decimal_ids = header.decimal(ID)
        if not decimal_ids and first.decimal_ids():
            decimal_ids, notes = True, ("ids are taken as decimal: as hexadecimal some are none",)
    layout = Layout(
        np.array(header.roles(), np.uint8),
        ord(header.separator),
        KINDS[kind],
        time_ns or header.unit_ns() or first.unit_ns(),
        decimal_ids,
        header.decimal(DATA) or header.decimal(BYTE) if decimal_data is None else decimal_data,
        first.first_channel() if first_channel is None else first_channel,
    )
    source.read(header.end)
    last = 0
    text = _Joined(source) if b"[" in source.head[header.end :] else source
    for frames in undated(text, lambda *table: _scan(layout, *table)):
        t_ns, absolute = frames.t_ns, frames.absolute
        if kind == "date":
            t_ns, absolute = t_ns if zoned else from_local(t_ns), True
        elif kind == "clock":
            t_ns, absolute = past_midnight(t_ns, last), False
            last = int(t_ns[-1]) if len(t_ns) else last
        yield replace(frames, t_ns=t_ns, absolute=absolute, notes=notes)


@dataclass(frozen=True, slots=True)
class _Joined:
    """The lines of a source; those of a list in brackets that goes over several are one."""

    source: LogSource

    def lines(self) -> Iterator[Bytes]:
        """Blocks of whole lines."""
        held = np.zeros(0, np.uint8)
        for block in self.source.lines():
            text = np.concatenate([held, block]) if len(held) else block
            end = _join(text)
            held = text[end:].copy()
            yield text[:end]
        if len(held):
            yield held


@compiled
def _join(text: Bytes) -> int:
    """Puts a blank for every newline within brackets; behind the last line that is whole."""
    opened, end = -1, int(np.int64(0))
    for i in range(len(text)):
        char = text[i]
        if char == 91:  # [
            opened = i
        elif char == 93 and opened >= 0:  # ]
            if i - opened < _LONGEST:
                for k in range(opened, i):
                    if text[k] == 10:
                        text[k] = 32
            opened = -1
        elif char == 10 and (opened < 0 or i - opened >= _LONGEST):
            end, opened = i + 1, -1
    return end


@compiled
def _scan(layout: Layout, text: Bytes, out: Table, counts: Ints) -> int:
    """Fills the table; gives the number of frames, or -1 if a payload is wider than the table."""
    n = i = int(np.int64(0))
    row = np.zeros(_ROW, np.int64)
    while n >= 0 and i < len(text):
        end = _line(layout, text, i, n, out, row)
        i, n = behind_line(text, i, end, n, out, counts)
    return n


@compiled
def _line(layout: Layout, text: Bytes, i: int, n: int, out: Table, row: Ints) -> int:
    """Reads one line into row ``n``; the position of its newline, or why not."""
    if at_end(text, i) >= 0:
        return BLANK
    row[:], row[_STATED] = 0, -1
    column, columns = 0, len(layout.roles)
    while column < columns or layout.roles[columns - 1] == BYTE:  # a header may name 8 of 64 bytes
        role = layout.roles[min(column, columns - 1)]
        column += 1
        i = blanks(text, i) if layout.separator != 9 else i
        quoted = text[i] == 34
        i += quoted
        behind = _cell(layout, role, text, i, quoted, n, out, row)
        if behind < 0:
            return behind
        i = field_end(text, behind, layout.separator, quoted)
        if text[i] == 10:
            break
        i += 1
    flag, count = row[_FLAGS], row[_COUNT]
    if flag & ERROR:
        flag &= ~EXTENDED
        if not row[_KNOWN]:
            out.id[n] = 0
    elif not row[_KNOWN]:
        return BAD_ID if row[_FILLED] else NO_FRAME
    length = frame_length(row[_STATED], count, flag)
    if not flag & (REMOTE | ERROR) and (length > count or not (row[_FILLED] or row[_STATED] == 0)):
        return TOO_SHORT
    for byte in range(0 if flag & REMOTE else length, count):
        out.data[n, byte] = 0
    if length > 8:
        flag |= FD
    out.channel[n], out.flags[n], out.length[n] = max(row[_CHANNEL], 0) & 0xFF, flag, length
    return line_end(text, i)


@compiled
def _cell(
    layout: Layout, role: int, text: Bytes, i: int, quoted: bool, n: int, out: Table, row: Ints
) -> int:
    """Reads the cell at ``i`` into row ``n`` or what is known of it; behind it, or why not."""
    separator = layout.separator
    if role == TIME:
        out.t_ns[n], behind = _time(layout, text, i, quoted)
        return behind if behind > i and cell_ends(text, behind, separator) else BAD_TIME
    if role == ID:
        if text[i] <= 32 or text[i] == 34 or text[i] == separator:
            return i
        behind, flags = identifier(text, i, separator, layout.decimal_ids, n, out)
        row[_KNOWN] = not flags & ERROR
        row[_FLAGS] |= flags
        return behind if behind >= 0 else BAD_ID
    if role == LENGTH:
        stated, behind = decimal(text, i)
        row[_STATED] = stated if behind > i and stated <= 64 else -1
        return behind
    if role == CHANNEL:
        row[_CHANNEL] = channel_number(text, i, separator) - layout.first_channel
        return i
    if DATA <= role <= BYTE:
        commas, count = quoted or separator != 44, row[_COUNT]
        if role == DATA and text[i] == 91:  # [
            count, behind = decimal_payload(text, i + 1, count, True, commas, n, out)
        elif layout.decimal_data:
            count, behind = decimal_payload(text, i, count, role == DATA, commas, n, out)
        else:
            count, behind = payload(text, i, count, role == DATA, commas, n, out)
        row[_COUNT], row[_FILLED] = count, 1
        row[_FLAGS] |= REMOTE if behind == i and is_letter(text[i], 114) else 0  # RTR, remote
        return behind if count >= 0 else count
    if role == BITS:
        bits, behind = decimal(text, i)
        row[_FLAGS] |= flags_of_kvaser(bits)
        return behind
    row[_FLAGS] |= flags_of(role, text, i) if role != SKIP else 0
    return i


@compiled
def _time(layout: Layout, text: Bytes, i: int, quoted: bool) -> tuple[int, int]:
    """(ns, position behind) of a time of the kind of this file."""
    comma = quoted or layout.separator != 44
    if layout.time_kind == _DATES:
        return date_ns(text, i, comma)
    if layout.time_kind == _CLOCKS:
        return clock_ns(text, i, comma)
    return number_ns(text, i, layout.time_ns, comma)
