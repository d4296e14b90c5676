"""Kvaser's texts: CanKing's log and the plain text of the converters for Memorator files.

CanKing: `` 0    0CFBFFDB X       8  1B  31  20  EB  B3  FF  D9  FF     100.000139 R``, channels
from 0 on, ids and bytes hexadecimal.  Plain text: ``100.000139  1   CFBFFDBx   Rx     8  1B 31 …``,
channels from 1 on, the length as a code, a count of frames at the end; its head states whether ids
and bytes are decimal, and when it was begun.  Sources: Kvaser, kvlclib's writer of plain text;
SavvyCAN's reader of CanKing's logs.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from clutchest.can.frames import LENGTHS, Frames
from clutchest.can.log_format import LogFormat, has_line
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
    NO_FRAME,
    REMOTE,
    SENT,
    STATUS,
    TOO_SHORT,
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
    undated,
    word,
)
from clutchest.can.text_times import local_date_ns, number_ns

_CANKING = rb"[ \t]*Chn[ \t]+Identifier[ \t]+Flg[ \t]+DLC\b"
_PLAIN = rb"[ \t]+Kvaser Memorator Log|[ \t]+Time[ \t]+Chan[ \t]+Identifier[ \t]+Flags[ \t]+DLC\b"
_plain = has_line(_PLAIN)
_BEGUN = re.compile(rb"^Memorator Binary logfile created at: ([^\r\n]*)", re.MULTILINE)


class _Layout(NamedTuple):
    """Whether a text is the ``plain`` one, and the bases of ids and bytes."""

    plain: bool
    id_base: int
    data_base: int


def read(source: LogSource) -> Iterator[Frames]:
    """Frames of such a log; lines that cannot be read are counted in ``rejected``."""
    head = source.head
    plain = _plain(head) is not None
    decimal_ids = plain and re.search(rb"Format of id field: *DEC", head) is not None
    decimal_data = plain and re.search(rb"Format of data field: *DEC", head) is not None
    layout = _Layout(plain, 10 if decimal_ids else 16, 10 if decimal_data else 16)
    begun = _BEGUN.search(head) if plain else None
    start_ns = local_date_ns(begun[1]) if begun else None
    for frames in undated(source, lambda *table: _scan(layout, *table)):
        if start_ns is not None and not frames.absolute:
            frames = replace(frames, t_ns=frames.t_ns + start_ns, absolute=True)
        yield frames


@compiled
def _scan(layout: _Layout, text: Bytes, out: Table, counts: Ints) -> int:
    """Fills the table; gives the number of frames, or -1 if a payload is wider than the table."""
    n = i = int(np.int64(0))
    while n >= 0 and i < len(text):
        first = blanks(text, i)
        if at_end(text, first) >= 0 or text[first] > 57:
            end = BLANK  # words and rules between the frames
        elif layout.plain:
            end = _plain_line(layout, text, first, n, out)
        else:
            end = _canking_line(text, first, n, out)
        i, n = behind_line(text, i, end, n, out, counts)
    return n


@compiled
def _plain_line(layout: _Layout, text: Bytes, i: int, n: int, out: Table) -> int:
    """Reads a line of plain text into row ``n``; the position of its newline, or why not."""
    out.t_ns[n], behind = number_ns(text, i, 1_000_000_000, False)
    if behind == i or text[behind] > 32:
        return BAD_TIME
    i = blanks(text, behind)
    if text[i] > 57:  # a trigger
        return STATUS
    channel, behind = decimal(text, i)
    if behind == i or text[behind] > 32:
        return NO_FRAME
    flag, i = _identifier(text, blanks(text, behind), layout.id_base, n, out)
    if flag < 0:
        return flag
    end = line_end(text, i)
    count = 0
    flag |= SENT if (text[i] | 32) == 116 else 0  # Tx, TxRq
    if not flag & ERROR:
        flag, i = _letters(text, blanks(text, word(text, i)), flag)
        stated, behind = decimal(text, i)
        if behind == i or text[behind] > 32 or stated > 64:
            return BAD_DATA
        count = LENGTHS[stated] if flag & FD and stated < 16 else stated
        count = count if flag & FD else min(count, 8)
        if not flag & REMOTE:
            behind = spaced_bytes(text, behind, count, layout.data_base, out, n)
            if behind < 0:
                return behind
    out.channel[n], out.flags[n], out.length[n] = max(channel - 1, 0) & 0xFF, flag, count
    return end


@compiled
def _canking_line(text: Bytes, i: int, n: int, out: Table) -> int:
    """Reads a line of CanKing's into row ``n``; the position of its newline, or why not."""
    channel, behind = decimal(text, i)
    if behind == i or text[behind] > 32:
        return NO_FRAME
    flag, i = _identifier(text, blanks(text, behind), 16, n, out)
    if flag < 0:
        return flag
    flag, i = _letters(text, i, flag)
    end = line_end(text, i)  # before it stand time and direction
    way = _word_before(text, end, i)
    stamp = _word_before(text, way, i)
    out.t_ns[n], behind = number_ns(text, stamp, 1_000_000_000, True)
    direction = text[way] | 32
    if behind == stamp or text[behind] > 32 or (direction != 116 and direction != 114):  # T, R
        return BAD_TIME
    flag |= SENT if direction == 116 else 0
    count = 0
    if not flag & ERROR:
        count, behind = decimal(text, i)
        if behind == i or text[behind] > 32 or behind > stamp:
            return BAD_DATA
        if not flag & REMOTE:
            stated, count = count, _words(text, behind, stamp)
            if count < min(stated, 8):
                return TOO_SHORT
            coded = 8 < stated < 16 and (count == 8 or count == LENGTHS[stated])
            if count > 64 or not (count == stated or coded):
                return BAD_DATA
            behind = spaced_bytes(text, behind, count, 16, out, n)
            if behind < 0:
                return behind
    if count > 8:
        flag |= FD
    out.channel[n], out.flags[n], out.length[n] = channel & 0xFF, flag, min(count, 64)
    return end


@compiled
def _identifier(text: Bytes, i: int, base: int, n: int, out: Table) -> tuple[int, int]:
    """(flags, position of the next word) of an id, ``x`` joined to it, or of ``ErrorFrame``; a
    negative number is the reason why not."""
    if (text[i] | 32) == 101 and (text[i + 1] | 32) == 114:  # Er
        out.id[n] = 0
        return ERROR, blanks(text, word(text, i))
    value, behind = hexadecimal(text, i) if base == 16 else decimal(text, i)
    wide = (text[behind] | 32) == 120
    if behind == i or text[behind + wide] > 32 or value > 0x1FFFFFFF:
        return BAD_ID, i
    out.id[n] = value
    return (EXTENDED if wide or value > 0x7FF else 0), blanks(text, behind + wide)


@compiled
def _letters(text: Bytes, i: int, flag: int) -> tuple[int, int]:
    """(flags, position behind) of the letters before the length, and of ``ErrorFrame``."""
    while text[i] > 57 or text[i] == 35:  # up to a number; # is an overrun
        if (text[i] | 32) == 101 and (text[i + 1] | 32) == 114:  # Er
            return ERROR, blanks(text, word(text, i))
        while text[i] > 32:
            letter = text[i] | 32
            flag |= EXTENDED if letter == 120 else REMOTE if letter == 114 else 0
            flag |= FD if letter == 102 else BRS if letter == 98 else ESI if letter == 112 else 0
            i += 1
        i = blanks(text, i)
    return flag, i


@compiled
def _word_before(text: Bytes, i: int, first: int) -> int:
    """Where the word begins that ends before ``i``, not before ``first``."""
    while i > first and text[i - 1] <= 32:
        i -= 1
    while i > first and text[i - 1] > 32:
        i -= 1
    return i


@compiled
def _words(text: Bytes, i: int, end: int) -> int:
    """How many words there are from ``i`` to ``end``, both of them between words."""
    count = 0
    for k in range(i + 1, end):
        count += text[k] > 32 and text[k - 1] <= 32
    return count


FORMAT = LogFormat(
    title="Kvaser text",
    about="Kvaser's: CanKing's log, and the converters' plain text",
    suffix=".txt",
    sniff=has_line(_CANKING + rb"|" + _PLAIN),
    read=read,
)
