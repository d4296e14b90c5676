"""Vector's text log, hexadecimal, stamps from the start of the measurement."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime

import numpy as np

from clutchest.can.frames import LENGTH_CODE, Flag, Frames
from clutchest.can.text_lines import Lines, decimals, has, written

_DAY_NAMES = ("Mon", "Tue", "Wed", "Thu", "Fri", "Sat", "Sun")
_MONTH_NAMES = ("Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec")


def write(frames: Frames) -> Iterator[bytes]:
    """The log in pieces.  It starts at a full second; without a date it has none in the header."""
    start_ns = 0
    date = ""
    if frames.absolute and len(frames):
        start_ns = int(frames.t_ns.min()) // 10**9 * 10**9
        start = datetime.fromtimestamp(start_ns // 10**9)
        day, month = _DAY_NAMES[start.weekday()], _MONTH_NAMES[start.month - 1]
        date = f"{day} {month} {start:%d %H:%M:%S}.000 {start.year}"
        yield f"date {date}\n".encode()
    yield b"base hex  timestamps absolute\ninternal events logged\n"
    if date:
        yield f"Begin Triggerblock {date}\n   0.000000 Start of measurement\n".encode()
    places = decimals(frames, 0)

    def line(piece: Frames) -> Lines:
        fd, remote, error = (has(piece, f) for f in (Flag.FD, Flag.REMOTE, Flag.ERROR))
        sent, data, code = has(piece, Flag.SENT), ~(remote | error), LENGTH_CODE[piece.length]
        classic, long = ~(fd | error), fd & ~error
        lines = Lines(len(piece)).put("   ").point(piece.t_ns - start_ns, 10**9, places)
        lines.put(" CANFD  ", fd).put(" ").number(piece.channel.astype(int) + 1)
        direction = Lines(len(piece)).put("Rx", ~sent).put("Tx", sent)
        for chars, shown in zip(direction.chars, direction.shown, strict=True):
            lines.put(" ", shown[:, 0] & fd).put(chars, shown & fd[:, None])
        lines.put("  ErrorFrame", error).put("  ", ~error)
        digits = np.maximum(1, (np.ceil(np.log2(piece.id + 1.0) / 4)).astype(int))
        lines.hexadecimal(piece.id, np.where(error, 0, digits))
        lines.put("x", has(piece, Flag.EXTENDED))
        for chars, shown in zip(direction.chars, direction.shown, strict=True):
            lines.put("  ", shown[:, 0] & classic).put(chars, shown & classic[:, None])
        lines.put("   d ", classic & ~remote).put("   r ", classic & remote)
        for flag in (Flag.BITRATE_SWITCH, Flag.ERROR_STATE):
            lines.put(" 0", long & ~has(piece, flag)).put(" 1", long & has(piece, flag))
        lines.put(" ", long).hexadecimal(code, np.where(error, 0, 1))
        count = np.where(remote, 0, piece.length)
        tens = (count // 10 + ord("0"))[:, None].astype(np.uint8)
        ones = (count % 10 + ord("0"))[:, None].astype(np.uint8)
        lines.put(" ", long).put(tens, long & (count > 9)).put(ones, long)
        # Behind the payload are times and settings of the bus, which are not known.
        return lines.payload(piece, data, " ").put("  0 0 1000 0 0 0 0 0", long)

    yield from written(frames, line)
    if date:
        yield b"End TriggerBlock\n"
