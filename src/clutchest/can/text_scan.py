"""Compiled pieces from which the readers of text logs are made.

A block of text ends in a newline, which belongs to none of the classes below, so no function here
has to check where the block ends.  Positions are indices into the block; a function that matches
nothing returns the position at which it began.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from clutchest.can.frames import Flag, Frames
from clutchest.can.time_stamps import counts_from_epoch
from clutchest.native import compiled

Bytes = NDArray[np.uint8]
Ints = NDArray[np.int64]

EXTENDED, REMOTE, ERROR = int(Flag.EXTENDED), int(Flag.REMOTE), int(Flag.ERROR)
FD, BRS, ESI = int(Flag.FD), int(Flag.BITRATE_SWITCH), int(Flag.ERROR_STATE)
SENT = int(Flag.SENT)

# What a reader's function for one line gives back instead of the position behind it.
BLANK = -1  # nothing in it, or nothing that ought to be a frame
WIDE = -2  # a payload wider than the table
HEADER = -3  # to be read by Python
NO_FRAME, BAD_TIME, BAD_ID, BAD_DATA, TOO_SHORT, STATUS = -4, -5, -6, -7, -8, -9
REASONS = {
    NO_FRAME: "no CAN frame in this line",
    BAD_TIME: "time stamp cannot be read",
    BAD_ID: "id is not a CAN id",
    BAD_DATA: "payload cannot be read or is too long",
    TOO_SHORT: "payload is shorter than its stated length",
    STATUS: "status of the bus, no frame",
}
N_CODES = 10
SHORTEST = 5  # characters of a line that holds a frame; the least there can be are 6

HEX = np.full(256, -1, np.int64)  # value of a hexadecimal digit
for _value, _chars in enumerate(zip("0123456789abcdef", "0123456789ABCDEF", strict=True)):
    HEX[[ord(char) for char in _chars]] = _value


class TextSource(Protocol):
    """What has a text."""

    def lines(self) -> Iterator[Bytes]:
        """Blocks of whole lines, each valid until the next is asked for."""


class Table(NamedTuple):
    """The columns that a reader fills; see :class:`Frames`."""

    t_ns: NDArray[np.int64]
    channel: NDArray[np.uint8]
    id: NDArray[np.uint32]
    flags: NDArray[np.uint8]
    length: NDArray[np.uint8]
    data: NDArray[np.uint8]

    @classmethod
    def of(cls, rows: int, width: int) -> Table:
        """Room for ``rows`` frames of at most ``width`` bytes."""
        return cls(
            np.empty(rows, np.int64),
            np.empty(rows, np.uint8),
            np.empty(rows, np.uint32),
            np.empty(rows, np.uint8),
            np.empty(rows, np.uint8),
            np.zeros((rows, width), np.uint8),
        )

    def frames(self, n: int, rejected: tuple[tuple[str, int], ...] = ()) -> Frames:
        """The first ``n`` rows, with what was rejected."""
        frames = Frames(
            self.t_ns[:n],
            self.channel[:n],
            self.id[:n],
            self.flags[:n],
            self.length[:n],
            self.data[:n],
            rejected=rejected,
        )
        # The slices would hold on to the room that was not needed.
        return frames if 2 * n >= len(self.t_ns) else frames.take(np.arange(n))


def filled(text: Bytes, width: int, scan: Callable[[Bytes, Table, Ints], int]) -> Frames:
    """The frames in a block of whole lines.

    ``scan`` fills the table and its counts of rejected lines, and gives the number of frames, or a
    negative one where a payload is wider than the table.  ``width`` is the one to try first.
    """
    rows = min(line_count(text), len(text) // SHORTEST) + 1
    n = WIDE
    while n < 0:
        counts, out = np.zeros(N_CODES, np.int64), Table.of(rows, width)
        n = scan(text, out, counts)
        width = 64
    rejected = ((reason, int(counts[-code])) for code, reason in REASONS.items())
    return out.frames(n, tuple((reason, count) for reason, count in rejected if count))


def tables(source: TextSource, scan: Callable[[Bytes, Table, Ints], int]) -> Iterator[Frames]:
    """The frames of every block of lines; ``scan`` as in :func:`filled`."""
    width = 8
    for block in source.lines():
        frames = filled(block, width, scan)
        width = frames.data.shape[1]
        yield frames


def undated(source: TextSource, scan: Callable[[Bytes, Table, Ints], int]) -> Iterator[Frames]:
    """The same of a format that does not state from when it counts: the first frame shows it."""
    absolute = None
    for frames in tables(source, scan):
        if absolute is None and len(frames):
            absolute = counts_from_epoch(frames.t_ns)
        yield replace(frames, absolute=absolute is not False)


@compiled
def line_count(text: Bytes) -> int:
    """How many lines there are."""
    count = 0
    for char in text:
        count += char == 10
    return count


@compiled
def blanks(text: Bytes, i: int) -> int:
    """Behind blanks and tabs."""
    while text[i] == 32 or text[i] == 9:
        i += 1
    return i


@compiled
def word(text: Bytes, i: int) -> int:
    """Behind whatever is no white space."""
    while text[i] > 32:
        i += 1
    return i


@compiled
def at_end(text: Bytes, i: int) -> int:
    """The newline, if only white space precedes it, else -1."""
    while text[i] <= 32 and text[i] != 10:
        i += 1
    return i if text[i] == 10 else -1


@compiled
def line_end(text: Bytes, i: int) -> int:
    """The newline that ends this line."""
    while text[i] != 10:
        i += 1
    return i


@compiled
def decimal(text: Bytes, i: int) -> tuple[int, int]:
    """(value, position behind) of at most 18 decimal digits."""
    value, limit = 0, i + 18
    while 48 <= text[i] <= 57 and i < limit:
        value = value * 10 + (text[i] - 48)
        i += 1
    return value, i


@compiled
def hexadecimal(text: Bytes, i: int) -> tuple[int, int]:
    """(value, position behind) of at most 15 hexadecimal digits."""
    value, limit = 0, i + 15
    while HEX[text[i]] >= 0 and i < limit:
        value = value * 16 + HEX[text[i]]
        i += 1
    return value, i


@compiled
def stamp(text: Bytes, i: int, unit_ns: int) -> tuple[int, int]:
    """(ns, position behind) of a decimal number in ``unit_ns``; digits beyond 1 ns are dropped."""
    first = i + 1 if text[i] == 45 else i  # -
    whole, behind = decimal(text, first)
    if behind == first or whole > 9_000_000_000_000_000_000 // unit_ns:
        return 0, i
    ns = whole * unit_ns
    if text[behind] == 46:
        behind += 1
        while 48 <= text[behind] <= 57:
            unit_ns //= 10
            ns += (text[behind] - 48) * unit_ns
            behind += 1
    return (-ns if first > i else ns), behind


@compiled
def spaced_bytes(text: Bytes, i: int, count: int, base: int, out: Table, n: int) -> int:
    """``count`` bytes with blanks between them into row ``n``; behind them, or why not."""
    if count > out.data.shape[1]:
        return WIDE
    for byte in range(count):
        i = blanks(text, i)
        if text[i] <= 32:
            return TOO_SHORT
        if base == 16:
            high, low = HEX[text[i]], HEX[text[i + 1]]
            if high >= 0 and text[i + 1] <= 32:
                return TOO_SHORT
            if high < 0 or low < 0 or text[i + 2] > 32:
                return BAD_DATA
            out.data[n, byte] = high * 16 + low
            i += 2
        else:
            value, behind = decimal(text, i)
            if behind == i or value > 255 or text[behind] > 32:
                return BAD_DATA
            out.data[n, byte] = value
            i = behind
    return i


@compiled
def rejected_line(text: Bytes, i: int, why: int, n: int, out: Table, counts: Ints) -> int:
    """Counts the line that begins at ``i`` as ``why``, clears row ``n``; behind the line."""
    counts[-why] += 1
    for byte in range(out.data.shape[1]):
        out.data[n, byte] = 0
    return line_end(text, i) + 1


@compiled
def behind_line(text: Bytes, i: int, end: int, n: int, out: Table, counts: Ints) -> tuple[int, int]:
    """(where the next line begins, frames so far) after the line at ``i`` was read into row ``n``.

    ``end`` is the position of its newline, or why it holds no frame; −1 frames where a payload is
    wider than the table.
    """
    if end >= 0:
        return end + 1, n + 1
    if end == WIDE:
        return i, -1
    return rejected_line(text, i, end, n, out, counts), n


@compiled
def is_word(text: Bytes, i: int, small: Bytes) -> bool:
    """Whether the word ``small`` (lower case) is here, in upper or lower case."""
    for k in range(len(small)):
        if (text[i + k] | 32) != small[k]:  # a newline ends this before the block does
            return False
    return bool(text[i + len(small)] <= 32)
