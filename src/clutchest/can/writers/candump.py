"""The compact candump layout, ``(1436509052.249713) can0 18FEF100#FF00``, written by column."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from clutchest.can.frames import Flag, Frames

_HEX = np.frombuffer(b"0123456789ABCDEF", np.uint8)
_ROWS = 100_000  # rows per piece: bounds the memory


def write(frames: Frames) -> Iterator[bytes]:
    """The log in pieces.  Stamps have 6 decimals, or 9 where the frames need them."""
    decimals = 6 if not np.any(frames.t_ns % 1000) else 9
    for start in range(0, len(frames), _ROWS):
        yield _piece(frames.take(np.arange(start, min(start + _ROWS, len(frames)))), decimals)


def _piece(frames: Frames, decimals: int) -> bytes:
    n = len(frames)

    def has(flag: Flag) -> NDArray[np.bool_]:
        return (frames.flags & flag) != 0

    def byte(char: str) -> NDArray[np.uint8]:
        return np.full((n, 1), ord(char), np.uint8)

    fd, remote, sent = has(Flag.FD), has(Flag.REMOTE), has(Flag.SENT)
    fd_bits = has(Flag.BITRATE_SWITCH) + 2 * has(Flag.ERROR_STATE).astype(np.uint8)
    seconds, rest = np.divmod(frames.t_ns, 1_000_000_000)
    width = max(3, len(str(int(seconds.max(initial=0)))))
    channel_digits = 1 + (frames.channel >= 10) + (frames.channel >= 100)
    long_id = has(Flag.EXTENDED) | has(Flag.ERROR)
    ids = frames.id | np.where(has(Flag.ERROR), np.uint32(0x20000000), np.uint32(0))
    payload = np.stack([_HEX[frames.data >> 4], _HEX[frames.data & 15]], axis=2).reshape(n, -1)
    payload_chars = np.where(remote, 0, 2 * frames.length.astype(int))

    # The longest line that there may be, and which of its characters each row has.
    always = np.ones(n, bool)
    parts = [
        (byte("("), always), (_decimal(seconds, width), always), (byte("."), always),
        (_decimal(rest // 10 ** (9 - decimals), decimals), always), (byte(")"), always),
        (byte(" "), always), (byte("c"), always), (byte("a"), always), (byte("n"), always),
        (_decimal(frames.channel, 3), np.arange(3) >= 3 - channel_digits[:, None]),
        (byte(" "), always),
        (_hexadecimal(ids, 8), (np.arange(8) >= 5) | long_id[:, None]),
        (byte("#"), always), (byte("#"), fd), (_hexadecimal(fd_bits, 1), fd),
        (byte("R"), remote), (_decimal(frames.length, 1), remote & (frames.length > 0)),
        (payload, np.arange(payload.shape[1]) < payload_chars[:, None]),
        (byte(" "), sent), (byte("T"), sent), (byte("\n"), always),
    ]  # fmt: skip
    text = np.hstack([chars for chars, _ in parts])
    shown = np.hstack([np.broadcast_to(mask.reshape(n, -1), chars.shape) for chars, mask in parts])
    return text[shown].tobytes()


def _decimal(values: NDArray, width: int) -> NDArray[np.uint8]:
    powers = 10 ** np.arange(width - 1, -1, -1, dtype=np.int64)
    return (values[:, None] // powers % 10 + ord("0")).astype(np.uint8)


def _hexadecimal(values: NDArray, width: int) -> NDArray[np.uint8]:
    shifts = 4 * np.arange(width - 1, -1, -1, dtype=np.uint32)
    return _HEX[values[:, None].astype(np.uint32) >> shifts & np.uint32(15)]
