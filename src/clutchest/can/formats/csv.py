"""python-can's csv: ``1705536000.01,0xcf00400,1,0,0,8,b/+EwBL///8=``; it has no channels."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from clutchest.can.frames import Flag, Frames
from clutchest.can.log_format import NO_CHANNELS, NO_DIRECTION, LogFormat, has_line
from clutchest.can.log_source import LogSource
from clutchest.can.text_lines import Lines, decimals, has, written
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
    WIDE,
    Bytes,
    Ints,
    Table,
    at_end,
    behind_line,
    compiled,
    decimal,
    hexadecimal,
    undated,
)
from clutchest.can.text_times import number_ns

HEADER = b"timestamp,arbitration_id,extended,remote,error,dlc,data"
_ALPHABET = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/"
_LETTERS = np.frombuffer(_ALPHABET, np.uint8)
_BASE64 = np.full(256, -1, np.int64)
_BASE64[_LETTERS] = np.arange(64)


def read(source: LogSource) -> Iterator[Frames]:
    """Frames of a csv log; lines that cannot be read are counted in ``rejected``."""
    return undated(source, _scan)


@compiled
def _scan(text: Bytes, out: Table, counts: Ints) -> int:
    """Fills the table; gives the number of frames, or -1 if a payload is wider than the table."""
    n = i = int(np.int64(0))
    while n >= 0 and i < len(text):
        end = _line(text, i, n, out)
        i, n = behind_line(text, i, end, n, out, counts)
    return n


@compiled
def _line(text: Bytes, i: int, n: int, out: Table) -> int:
    """Reads one line into row ``n``; the position of its newline, or why not."""
    if text[i] == 116:  # the header
        return BLANK
    t_ns, behind = number_ns(text, i, 1_000_000_000, False)
    if behind == i:
        return BLANK if at_end(text, i) >= 0 else NO_FRAME
    if text[behind] != 44:
        return BAD_TIME
    out.t_ns[n] = t_ns
    i = behind + 1
    if text[i] != 48 or (text[i + 1] | 32) != 120:  # 0x
        return BAD_ID
    value, behind = hexadecimal(text, i + 2)
    if behind == i + 2 or text[behind] != 44 or value > 0x1FFFFFFF:
        return BAD_ID
    out.id[n] = value
    i, flag = behind + 1, 0
    for bit in (EXTENDED, REMOTE, ERROR):
        if (text[i] != 48 and text[i] != 49) or text[i + 1] != 44:
            return BAD_DATA
        if text[i] == 49:
            flag |= bit
        i += 2
    if flag & ERROR:
        flag &= ~EXTENDED
    stated, behind = decimal(text, i)
    if behind == i or text[behind] != 44 or stated > 64:
        return BAD_DATA
    count, i = _payload(text, behind + 1, n, out)
    if count < 0:
        return count
    end = at_end(text, i)
    if end < 0:
        return BAD_DATA
    if flag & REMOTE:
        for byte in range(count):
            out.data[n, byte] = 0
        count = stated
    elif count > 8:
        flag |= FD  # the format has no flag for it
    out.channel[n], out.flags[n], out.length[n] = 0, flag, count
    return end


@compiled
def _payload(text: Bytes, i: int, n: int, out: Table) -> tuple[int, int]:
    """(bytes, position behind) of base64; a negative number is the reason why not."""
    count = bits = held = 0
    while _BASE64[text[i]] >= 0:
        bits = (bits << 6 | _BASE64[text[i]]) & 0xFFFF
        held += 6
        if held >= 8:
            held -= 8
            if count == 64:
                return BAD_DATA, i
            if count == out.data.shape[1]:
                return WIDE, i
            out.data[n, count] = bits >> held & 0xFF
            count += 1
        i += 1
    digits = (count * 8 + held) // 6
    while text[i] == 61 and digits % 4 != 0:  # =
        digits += 1
        i += 1
    return (count if digits % 4 == 0 else BAD_DATA), i


def write(frames: Frames) -> Iterator[bytes]:
    """The log in pieces."""
    places = decimals(frames, 0)
    yield HEADER + b"\n"

    def line(piece: Frames) -> Lines:
        remote = has(piece, Flag.REMOTE)
        lines = Lines(len(piece)).point(piece.t_ns, 10**9, places).put(",0x")
        lines.hexadecimal(piece.id, 8)
        for flag in (Flag.EXTENDED, Flag.REMOTE, Flag.ERROR):
            lines.put(",1", has(piece, flag)).put(",0", ~has(piece, flag))
        lines.put(",").number(piece.length).put(",")
        # base64: four letters for three bytes, missing ones become "="
        length = np.where(remote, 0, piece.length.astype(int))
        width = -(-piece.data.shape[1] // 3) * 3
        padded = np.pad(piece.data, ((0, 0), (0, width - piece.data.shape[1]))).astype(np.uint32)
        threes = padded[:, ::3] << 16 | padded[:, 1::3] << 8 | padded[:, 2::3]
        letters = _LETTERS[threes[:, :, None] >> np.array([18, 12, 6, 0]) & 63]
        letters = letters.reshape(len(piece), -1)
        place = np.arange(letters.shape[1])
        letters[place >= -(-length * 8 // 6)[:, None]] = ord("=")
        return lines.put(letters, place < (-(-length // 3) * 4)[:, None])

    yield from written(frames, line)


FORMAT = LogFormat(
    title=".csv of python-can",
    about="python-can's, or decoded signals",
    suffix=".csv",
    sniff=has_line(rb"timestamp, ?arbitration[_ ]id, ?extended, ?remote, ?error, ?dlc, ?data\b"),
    read=read,
    lines=write,
    losses=(NO_CHANNELS, NO_DIRECTION),
)
