"""PEAK's text log, versions 1.0 to 2.1.  Its start time makes the stamps absolute.

What the columns hold is stated by the version, or from 2.0 on by the file itself (``$COLUMNS``).
Source: PEAK-System, "PEAK CAN TRC File Format".
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np

from clutchest.can.frames import LENGTH_CODE, LENGTHS, Flag, Frames
from clutchest.can.log_format import LogFormat, has_line
from clutchest.can.log_source import LogSource
from clutchest.can.text_lines import Lines, decimals, has, written
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
    Bytes,
    Ints,
    Table,
    at_end,
    behind_line,
    blanks,
    compiled,
    decimal,
    hexadecimal,
    is_word,
    line_end,
    spaced_bytes,
    stamp,
    tables,
    word,
)
from clutchest.can.time_stamps import EPOCH_NS, LAST_S
from clutchest.errors import ClutchestError

_COLUMNS = {"1.0": "NOILD", "1.1": "NOTILD", "1.2": "NOBTILD", "1.3": "NOBTIRLD"}
_VERSION = re.compile(rb"^;\$FILEVERSION=(\d+\.\d+)", re.MULTILINE)
_START = re.compile(rb"^;\$STARTTIME=(\d+(?:\.\d+)?)", re.MULTILINE)
_STATED = re.compile(rb"^;\$COLUMNS=([A-Za-z](?:,[A-Za-z])*)", re.MULTILINE)
_HEAD = rb";(\$FILEVERSION|[ \t]*PCAN|##|[ \t]*Message Number|---\+)"
_LINE = re.compile(  # of versions up to 1.3: a bus, a direction, a dash
    rb"^[ \t]*\d+\)[ \t]+\d+(?:\.\d+)?[ \t]+(?:(\d)[ \t]+)?"
    rb"(?:([A-Za-z]{2,5})[ \t]+[0-9A-Fa-f]+[ \t]+(-)?|[0-9A-Fa-f]{4,8}[ \t]+\d+\b)",
    re.MULTILINE,
)
_ERROR_WORD, _WARNING_WORD = (np.frombuffer(word, np.uint8) for word in (b"error", b"warng"))
_DAY_0 = datetime(1899, 12, 30, tzinfo=UTC)
_LAST_DAY = 25_569 + LAST_S // 86_400
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def read(source: LogSource) -> Iterator[Frames]:
    """Frames of a trc log; lines that cannot be read are counted in ``rejected``."""
    stated = _columns(source.head)
    if missing := [name for name in ("O", "I", "lL", "D") if not set(name) & set(stated)]:
        raise ClutchestError(f"{source.path}: its $COLUMNS name no {', '.join(missing)}")
    columns = np.frombuffer(stated.encode(), np.uint8)
    start_ns = _start_ns(source.head)
    for frames in tables(source, lambda *table: _scan(columns, start_ns, *table)):
        yield replace(frames, absolute=start_ns >= EPOCH_NS)


def _columns(head: bytes) -> str:
    version = _VERSION.search(head)
    stated = _STATED.search(head)
    if version and version[1] >= b"2.0" and stated:
        return stated[1].decode().replace(",", "")
    if version:
        return _COLUMNS.get(version[1].decode(), "NOTILD")
    line = _LINE.search(head)
    if line is None or line[2] is None:  # 1.0, which states no version
        return _COLUMNS["1.0"]
    return _COLUMNS["1.1" if not line[1] else "1.3" if line[3] == b"-" else "1.2"]


def _start_ns(head: bytes) -> int:
    """The date of the first line's zero in ns since 1970; 0 without one."""
    days = _START.search(head)
    if not days or not 0 < float(days[1]) < _LAST_DAY:
        return 0
    since = _DAY_0 + timedelta(days=float(days[1])) - _EPOCH
    return since // timedelta(microseconds=1) * 1000


@compiled
def _scan(columns: Bytes, start_ns: int, text: Bytes, out: Table, counts: Ints) -> int:
    """Fills the table; gives the number of frames, or -1 if a payload is wider than the table."""
    n = i = int(np.int64(0))
    while n >= 0 and i < len(text):
        end = _line(text, blanks(text, i), columns, start_ns, n, out)
        i, n = behind_line(text, i, end, n, out, counts)
    return n


@compiled
def _line(text: Bytes, i: int, columns: Bytes, start_ns: int, n: int, out: Table) -> int:
    """Reads one line into row ``n``; the position of its newline, or why not."""
    if text[i] == 59 or at_end(text, i) >= 0:  # ;
        return BLANK
    flag = channel = count = 0
    for column in columns:
        i = blanks(text, i)
        if column == 79:  # O: offset, ms
            t_ns, behind = stamp(text, i, 1_000_000)
            if behind == i or text[behind] > 32:
                return BAD_TIME if text[i] > 32 else NO_FRAME
            out.t_ns[n] = start_ns + t_ns
            i = behind
        elif column == 84:  # T: direction of a data frame up to 1.3, kind from 2.0 on
            kind = _kind(text, i)
            if kind < 0:
                return kind
            flag |= kind
            i = word(text, i)
        elif column == 66:  # B: bus, from 1 on
            channel, i = decimal(text, i)
            if text[i] > 32:
                return NO_FRAME
        elif column == 73 and flag & ERROR:  # what follows describes the error
            out.id[n] = 0
            break
        elif column == 73:  # I: id
            value, behind = hexadecimal(text, i)
            if behind - i > 4:
                flag |= EXTENDED
            if text[i] <= 32 or value == 0xFFFFFFFF:  # 1.0 has this id for the bus's status
                return NO_FRAME if text[i] <= 32 else STATUS
            if behind == i or text[behind] > 32 or value > 0x1FFFFFFF:
                return BAD_ID
            out.id[n] = value
            i = behind
        elif column == 100:  # d: direction
            flag |= SENT if text[i] == 84 else 0
            i = word(text, i)
        elif column == 76 or column == 108:  # L: length code, l: length
            count, behind = decimal(text, i)
            if behind == i or text[behind] > 32 or count > (64 if column == 108 else 15):
                return BAD_DATA
            if column == 76:
                count = LENGTHS[count] if flag & FD else min(count, 8)
            elif count > 8:
                flag |= FD
            i = behind
        elif column == 68:  # D: payload
            if text[i] == 82 and text[i + 1] == 84 and text[i + 2] == 82:  # RTR
                flag |= REMOTE
                i = word(text, i)
            elif not flag & REMOTE:
                i = spaced_bytes(text, i, count, 16, out, n)
                if i < 0:
                    return i
        else:  # N, R and what else there may be
            i = word(text, i)
    out.channel[n], out.flags[n], out.length[n] = max(channel - 1, 0) & 0xFF, flag, count
    return line_end(text, i)


@compiled
def _kind(text: Bytes, i: int) -> int:
    """Flags of a line of this type; STATUS or NO_FRAME if it is no frame."""
    if is_word(text, i, _ERROR_WORD):  # up to 1.3
        return ERROR
    if is_word(text, i, _WARNING_WORD):
        return STATUS
    if text[i] <= 32 or text[i + 1] <= 32 or text[i + 2] > 32:
        return NO_FRAME
    a, b = text[i], text[i + 1]
    if b == 120 and (a == 82 or a == 84):  # Rx, Tx
        return SENT if a == 84 else 0
    if a == 68 and b == 84:  # DT
        return 0
    if a == 69 and b == 82:  # ER
        return ERROR
    if a == 82 and b == 82:  # RR
        return REMOTE
    if a == 70 and b == 68:  # FD
        return FD
    if a == 70 and b == 66:  # FB
        return FD | BRS
    if a == 70 and b == 69:  # FE
        return FD | BRS | ESI
    if a == 66 and b == 73:  # BI
        return FD | ESI
    if (a == 83 and b == 84) or (a == 69 and (b == 67 or b == 86)):  # ST, EC, EV
        return STATUS
    return NO_FRAME


_DAY_0_S = 25569 * 86400  # from 30 December 1899 to 1 January 1970
# type → flags of its frames
_TYPES = {
    "DT": Flag(0),
    "RR": Flag.REMOTE,
    "FD": Flag.FD,
    "FB": Flag.FD | Flag.BITRATE_SWITCH,
    "FE": Flag.FD | Flag.BITRATE_SWITCH | Flag.ERROR_STATE,
    "BI": Flag.FD | Flag.ERROR_STATE,
}
_KIND = Flag.FD | Flag.BITRATE_SWITCH | Flag.ERROR_STATE | Flag.REMOTE | Flag.ERROR


def write(frames: Frames) -> Iterator[bytes]:
    """The log in pieces.  It starts at a full second."""
    start_s = int(frames.t_ns.min(initial=0 if not len(frames) else frames.t_ns[0])) // 10**9
    start_s = start_s if frames.absolute else 0
    yield (
        ";$FILEVERSION=2.1\n"
        f";$STARTTIME={(start_s + _DAY_0_S) / 86400!r}\n"
        ";$COLUMNS=N,O,T,B,I,d,R,L,D\n;\n;   Written by clutchest\n"
        ";-------------------------------------------------------------------------------\n"
        ";   Message   Time    Type    ID     Rx/Tx\n"
        ";   Number    Offset  |  Bus  [hex]  |  Reserved\n"
        ";   |         [ms]    |  |    |      |  |  Data Length Code\n"
        ";   |         |       |  |    |      |  |  |    Data [hex] ...\n"
        ";---+-- ------+------ +- +- --+----- +- +- +--- +- -- -- -- -- -- -- --\n"
    ).encode()
    places, number = decimals(frames, 3), 0

    def line(piece: Frames) -> Lines:
        nonlocal number
        n = len(piece)
        sent, remote = has(piece, Flag.SENT), has(piece, Flag.REMOTE)
        lines = Lines(n).put("  ").number(np.arange(number + 1, number + n + 1)).put(" ")
        lines.point(piece.t_ns - start_s * 10**9, 10**6, places).put(" ")
        error = has(piece, Flag.ERROR)
        for name, flags in _TYPES.items():
            lines.put(name, (piece.flags & _KIND) == flags)
        lines.put("ER", error)
        lines.put(" ").number(piece.channel.astype(int) + 1).put(" ")
        digits = np.where(has(piece, Flag.EXTENDED), 8, 4)
        lines.put("-", error).hexadecimal(piece.id, np.where(error, 0, digits))
        length = np.where(error, 0, LENGTH_CODE[piece.length])
        lines.put(" Rx - ", ~sent).put(" Tx - ", sent).number(length)
        number += n
        return lines.payload(piece, ~(remote | error), " ")

    yield from written(frames, line)


FORMAT = LogFormat(
    title=".trc",
    about="PEAK, versions 1.0 to 2.1, CAN FD, error frames",
    suffix=".trc",
    sniff=has_line(
        rb";(\$FILEVERSION|[ \t]*PCAN|##|[ \t]*Message Number|---\+)|" + _LINE.pattern[1:]
    ),
    read=read,
    lines=write,
)
