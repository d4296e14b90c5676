"""candump logs: the compact layout of ``candump -l`` and the console layout, as columns.

Compact: ``(1436509052.249713) can0 18FEF100#FF00``, CAN FD ``ID##<flags>DATA``, remote ``ID#R8``,
error frames with bit 29 of the id set, an ``R`` or ``T`` for the direction behind.
Console: ``(000.005580)  can0  18E0FF00   [8]  00 FF …``, ``remote request``, ``ERRORFRAME``; bytes
in bits (-i), and with ` between them, the last one first (-S).
Stamps are s since 1970 (-ta), a local date and time (-tA), s since the first frame (-tz) or since
the frame before (-td).
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from clutchest.can.frames import Flag, Frames
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
    spaced_bytes,
    stamp,
    undated,
)
from clutchest.can.text_times import date_ns, from_local
from clutchest.can.time_stamps import EPOCH_NS
from clutchest.errors import ClutchestError

FEW = 32  # frames that are written sooner one by one than column by column


_PLAIN, _DELTAS, _DATES = range(3)  # kinds of stamps
_KIND, _NOW = range(2)  # what a clock holds: the kind, and the last time
_STAMP = re.compile(rb"^[ \t]*\((-?\d+(?:\.\d+)?)\)", re.MULTILINE)
_DATE = rb"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d\.\d+"
_stamped = has_line(rb"[ \t]*\((-?\d+(\.\d+)?|" + _DATE + rb")\)[ \t]+\S+[ \t]")
_unstamped = has_line(
    rb"[ \t]*[A-Za-z][\w.-]*[ \t]+((TX|RX)[ \tBE-]+)?([0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})"
    rb"([ \t]+\[\d\d?\][ \t\r\n]|#)"
)
_OFTEN, _FEWEST = 0.2, 5  # share of steps back, of so many stamps, that times since the start lack


def read(source: LogSource) -> Iterator[Frames]:
    """Frames of a candump log; lines that cannot be read are counted in ``rejected``.

    Raises ClutchestError for a log without time stamps.
    """
    if _stamped(source.head) is None and _unstamped(source.head) is not None:
        raise ClutchestError(
            f"{source.path}: a candump without time stamps, of which no drive can be made; "
            "expected one recorded with `candump -l can0` or `candump -ta can0`"
        )
    clock = np.array([_kind(source.head), 0], np.int64)

    def scan(text: Bytes, out: Table, counts: Ints) -> int:
        before = clock[_NOW]
        n = _scan(text, clock, out, counts)
        if n < 0:
            clock[_NOW] = before
        return n

    for frames in undated(source, scan):
        dated = clock[_KIND] == _DATES
        yield replace(frames, t_ns=from_local(frames.t_ns)) if dated else frames


def _kind(head: bytes) -> int:
    """Which stamps these are; times since the frame before are known by not rising."""
    date, first = re.search(rb"^[ \t]*\(" + _DATE, head, re.MULTILINE), _STAMP.search(head)
    if date is not None and (first is None or date.start() < first.start()):
        return _DATES
    if first is None or float(first[1]) * 1e9 >= EPOCH_NS:
        return _PLAIN
    stamps = np.array(_STAMP.findall(head), np.float64)
    backward = np.mean(np.diff(stamps) <= 0.0) if len(stamps) >= _FEWEST else 0.0
    return _DELTAS if backward > _OFTEN else _PLAIN


@compiled
def _scan(text: Bytes, clock: Ints, out: Table, counts: Ints) -> int:
    """Fills the table; gives the number of frames, or -1 if a payload is wider than the table."""
    n = i = int(np.int64(0))  # a literal 0 would have all of this compiled twice
    while n >= 0 and i < len(text):
        end = _line(text, blanks(text, i), n, clock, out)
        i, n = behind_line(text, i, end, n, out, counts)
    return n


@compiled
def _line(text: Bytes, i: int, n: int, clock: Ints, out: Table) -> int:
    """Reads one line into row ``n``; the position of its newline, or why not."""
    if text[i] != 40:  # (
        return BLANK if at_end(text, i) >= 0 else NO_FRAME
    if clock[_KIND] == _DATES:
        t_ns, behind = date_ns(text, i + 1, False)
    else:
        t_ns, behind = stamp(text, i + 1, 1_000_000_000)
    if behind == i + 1 or text[behind] != 41:  # )
        return BAD_TIME
    if clock[_KIND] == _DELTAS:
        t_ns += clock[_NOW]
        clock[_NOW] = t_ns
    out.t_ns[n] = t_ns
    i = blanks(text, behind + 1)

    # The channel is the number at the end of the interface's name.
    number = 0
    while text[i] > 32:
        number = number * 10 + (text[i] - 48) if 48 <= text[i] <= 57 else 0
        i += 1
    out.channel[n] = number & 0xFF
    i = blanks(text, i)
    flag = 0
    if (text[i] == 84 or text[i] == 82) and text[i + 1] == 88:  # TX or RX, then B and E or dashes
        if text[i] == 84:
            flag |= SENT
        i = blanks(text, i + 2)
        while text[i] == 45 or ((text[i] == 66 or text[i] == 69) and text[i + 1] <= 32):
            if text[i] == 66:
                flag |= BRS
            elif text[i] == 69:
                flag |= ESI
            i = blanks(text, i + 1)

    value, behind = hexadecimal(text, i)
    digits = behind - i
    if digits == 8:
        flag |= ERROR if value & 0x20000000 else EXTENDED
    elif digits != 3 or value > 0x7FF:
        return BAD_ID
    out.id[n] = value & 0x1FFFFFFF
    if text[behind] == 35:  # compact: #
        return _compact(text, behind + 1, n, flag, out)
    if text[behind] > 32:
        return BAD_ID
    return _console(text, blanks(text, behind), n, flag, out)


@compiled
def _compact(text: Bytes, i: int, n: int, flag: int, out: Table) -> int:
    widest, count = 8, 0
    if text[i] == 35:  # ##
        bits = HEX[text[i + 1]]
        if bits < 0:
            return BAD_DATA
        flag |= FD | (BRS if bits & 1 else 0) | (ESI if bits & 2 else 0)
        widest = 64
        i += 2
    if (text[i] == 82 or text[i] == 114) and widest == 8:  # R
        flag |= REMOTE
        i += 1
        if 48 <= text[i] <= 56:
            count = text[i] - 48
            i += 1
    else:
        while text[i] > 32 and text[i] != 95:
            high, low = HEX[text[i]], HEX[text[i + 1]]
            if high < 0 or low < 0 or count == widest:
                return BAD_DATA
            if count == out.data.shape[1]:
                return WIDE
            out.data[n, count] = high * 16 + low
            count += 1
            i += 2
    if text[i] == 95 and HEX[text[i + 1]] > 8:
        i += 2  # _9 … _F: a raw length code above 8
    i = blanks(text, i)
    if text[i] == 84 or text[i] == 82:  # the direction
        if text[i] == 84:
            flag |= SENT
        i += 1
    out.flags[n], out.length[n] = flag, count
    end = at_end(text, i)
    return end if end >= 0 else BAD_DATA


@compiled
def _console(text: Bytes, i: int, n: int, flag: int, out: Table) -> int:
    if text[i] != 91:  # [
        return BAD_ID
    stated, behind = decimal(text, i + 1)
    digits = behind - i - 1
    if digits < 1 or digits > 2 or text[behind] != 93:  # ]
        return BAD_DATA
    is_fd = digits == 2  # classic frames have one digit here
    if stated > (64 if is_fd else 8):
        return BAD_DATA
    if is_fd:
        flag |= FD
    i = blanks(text, behind + 1)
    if text[i] == 114:  # remote request
        flag |= REMOTE
    else:
        i = _payload(text, i, stated, out, n)
        if i < 0:
            return i
    out.flags[n], out.length[n] = flag, stated
    return line_end(text, i)


@compiled
def _payload(text: Bytes, i: int, count: int, out: Table, n: int) -> int:
    """``count`` bytes into row ``n``: hexadecimal, in bits (-i), or with ` between them the last
    one first (-S); behind them, or why not."""
    at = i
    while text[at] == 48 or text[at] == 49:
        at += 1
    if at - i == 8:
        return _unusual(text, i, count, 2, text[at] == 96, out, n)
    at = i
    while HEX[text[at]] >= 0:
        at += 1
    if at - i == 2 and text[at] == 96:
        return _unusual(text, i, count, 16, True, out, n)
    return spaced_bytes(text, i, count, 16, out, n)


@compiled
def _unusual(
    text: Bytes, i: int, count: int, base: int, last_first: bool, out: Table, n: int
) -> int:
    if count > out.data.shape[1]:
        return WIDE
    for byte in range(count):
        if byte > 0:
            if text[i] != (96 if last_first else 32):
                return TOO_SHORT if text[i] <= 32 else BAD_DATA
            i += 1
        value = 0
        for _ in range(2 if base == 16 else 8):
            digit = HEX[text[i]]
            if digit < 0 or digit >= base:
                return BAD_DATA
            value = value * base + digit
            i += 1
        out.data[n, count - 1 - byte if last_first else byte] = value
    return i if text[i] <= 32 else BAD_DATA


def write(frames: Frames) -> Iterator[bytes]:
    """The log in pieces.  Stamps have 6 decimals, or 9 where the frames need them."""
    places = decimals(frames, 0)
    digits = max(3, len(str(int(frames.t_ns.max(initial=0)) // 10**9)))
    plain = not np.any(frames.flags & ~np.uint8(Flag.EXTENDED)) and np.all(frames.t_ns >= 0)
    if len(frames) <= FEW and plain:
        yield b"".join(_plain(frames, places, digits))
        return

    def line(piece: Frames) -> Lines:
        fd, remote, sent = (has(piece, f) for f in (Flag.FD, Flag.REMOTE, Flag.SENT))
        error = has(piece, Flag.ERROR)
        ids = piece.id | np.where(error, np.uint32(0x20000000), np.uint32(0))
        bits = has(piece, Flag.BITRATE_SWITCH) + 2 * has(piece, Flag.ERROR_STATE).astype(np.uint8)
        lines = Lines(len(piece)).put("(").point(piece.t_ns, 10**9, places, digits).put(") can")
        lines.number(piece.channel).put(" ")
        lines.hexadecimal(ids, np.where(has(piece, Flag.EXTENDED) | error, 8, 3)).put("#")
        lines.put("#", fd).hexadecimal(bits, np.where(fd, 1, 0)).put("R", remote)
        length = (piece.length + ord("0"))[:, None]
        lines.put(length.astype(np.uint8), remote & (piece.length > 0))
        return lines.payload(piece, ~remote).put(" T", sent)

    yield from written(frames, line)


def _plain(frames: Frames, places: int, digits: int) -> Iterator[bytes]:
    """Lines of data frames, one at a time."""
    unit = 10 ** (9 - places)
    rows = zip(
        frames.t_ns.tolist(),
        frames.channel.tolist(),
        frames.id.tolist(),
        frames.flags.tolist(),
        frames.length.tolist(),
        frames.data,
        strict=True,
    )
    for t, channel, can_id, flags, length, data in rows:
        stamp = f"({t // 10**9:0{digits}d}.{t % 10**9 // unit:0{places}d})"
        name = f"{can_id:0{8 if flags else 3}X}"
        yield f"{stamp} can{channel} {name}#{data[:length].tobytes().hex().upper()}\n".encode()


def _sniff(head: bytes) -> int | None:
    at = _stamped(head)
    return at if at is not None else _unstamped(head)


FORMAT = LogFormat(
    title="candump (.log)",
    about="candump: compact `id#data`, FD `id##…`, console `id [n] …`, bytes also as -S and -i; "
    "stamps -ta, -tA, -tz, -td",
    suffix=".log",
    sniff=_sniff,
    read=read,
    lines=write,
)
