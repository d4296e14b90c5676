"""Lines of text from columns: each is the longest possible line less some characters."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from clutchest.can.frames import Flag, Frames

HEX = np.frombuffer(b"0123456789ABCDEF", np.uint8)
ROWS = 100_000  # rows per piece: bounds the memory


def pieces(frames: Frames) -> Iterator[Frames]:
    """The frames a bounded number at a time."""
    for start in range(0, len(frames), ROWS):
        yield frames.take(np.arange(start, min(start + ROWS, len(frames))))


def has(frames: Frames, flag: Flag) -> NDArray[np.bool_]:
    """Which frames have a flag; shape (n,)."""
    return (frames.flags & flag) != 0


def decimals(frames: Frames, unit_digits: int) -> int:
    """How many digits a stamp needs behind the point of a unit of 10^-``unit_digits`` s."""
    return (6 if not np.any(frames.t_ns % 1000) else 9) - unit_digits


@dataclass
class Lines:
    """``n`` lines, put together from left to right."""

    n: int
    chars: list[NDArray[np.uint8]] = field(default_factory=list)
    shown: list[NDArray[np.bool_]] = field(default_factory=list)

    def put(self, chars: NDArray[np.uint8] | str, where: ArrayLike = True) -> Lines:
        """The same text on every line, or a row each; only ``where`` (n,) or (n, w) it holds."""
        if isinstance(chars, str):
            same = np.frombuffer(chars.encode(), np.uint8)
            chars = np.broadcast_to(same, (self.n, len(same)))
        shown = np.asarray(where, bool)
        if shown.ndim == 1:
            shown = shown[:, None]
        self.chars.append(chars)
        self.shown.append(np.broadcast_to(shown, chars.shape))
        return self

    def number(self, values: NDArray, digits: int = 1) -> Lines:
        """A decimal number ≥ 0 of at least ``digits`` digits."""
        width = max(digits, len(str(int(values.max(initial=0)))))
        powers = 10 ** np.arange(width - 1, -1, -1, dtype=np.int64)
        needed = np.maximum(digits, 1 + np.sum(values[:, None] >= powers[:-1], axis=1))
        chars = (values[:, None] // powers % 10 + ord("0")).astype(np.uint8)
        return self.put(chars, np.arange(width) >= width - needed[:, None])

    def point(self, values: NDArray[np.int64], unit: int, decimals: int, digits: int = 1) -> Lines:
        """``values`` / ``unit`` with ``decimals`` digits behind the point."""
        if np.any(values < 0):
            self.put("-", values < 0)
        whole, rest = np.divmod(np.abs(values), unit)
        powers = 10 ** np.arange(decimals - 1, -1, -1, dtype=np.int64)
        rest = rest // (unit // 10**decimals)
        chars = (rest[:, None] // powers % 10 + ord("0")).astype(np.uint8)
        return self.number(whole, digits).put(".").put(chars)

    def hexadecimal(self, values: NDArray, digits: NDArray | int) -> Lines:
        """``digits`` (n,) hexadecimal digits, 8 at most."""
        shifts = 4 * np.arange(7, -1, -1, dtype=np.uint32)
        chars = HEX[values[:, None].astype(np.uint32) >> shifts & np.uint32(15)]
        return self.put(chars, np.arange(8) >= 8 - np.broadcast_to(digits, self.n)[:, None])

    def payload(self, frames: Frames, where: NDArray[np.bool_], before: str = "") -> Lines:
        """The bytes of the payload in hexadecimal, ``before`` in front of each."""
        n, width = frames.data.shape
        gap = np.frombuffer(before.encode(), np.uint8)
        columns = [HEX[frames.data >> 4], HEX[frames.data & 15]]
        columns = [np.full((n, width), char, np.uint8) for char in gap] + columns
        chars = np.stack(columns, axis=2).reshape(n, -1)
        count = np.where(where, len(columns) * frames.length.astype(int), 0)
        return self.put(chars, np.arange(chars.shape[1]) < count[:, None])

    def text(self) -> bytes:
        """All lines, a newline behind each."""
        self.put("\n")
        return np.hstack(self.chars)[np.hstack(self.shown)].tobytes()


def written(frames: Frames, line: Callable[[Frames], Lines]) -> Iterator[bytes]:
    """The lines of all frames, piece by piece."""
    for piece in pieces(frames):
        yield line(piece).text()
