"""The compact candump layout, ``(1436509052.249713) can0 18FEF100#FF00``."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from clutchest.can.frames import Flag, Frames
from clutchest.can.writers.text import Lines, decimals, has, written

FEW = 32  # frames that are written sooner one by one than column by column


def write(frames: Frames) -> Iterator[bytes]:
    """The log in pieces.  Stamps have 6 decimals, or 9 where the frames need them."""
    places = decimals(frames, 0)
    digits = max(3, len(str(int(frames.t_ns.max(initial=0)) // 10**9)))
    if len(frames) <= FEW and not np.any(frames.flags & ~np.uint8(Flag.EXTENDED)):
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
