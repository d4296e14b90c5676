"""python-can's csv, which knows neither channels nor directions."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from clutchest.can.frames import Flag, Frames
from clutchest.can.writers.text import Lines, decimals, has, written

_LETTERS = np.frombuffer(
    b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/", np.uint8
)


def write(frames: Frames) -> Iterator[bytes]:
    """The log in pieces."""
    places = decimals(frames, 0)
    yield b"timestamp,arbitration_id,extended,remote,error,dlc,data\n"

    def line(piece: Frames) -> Lines:
        remote = has(piece, Flag.REMOTE)
        lines = Lines(len(piece)).point(piece.t_ns, 10**9, places).put(",0x")
        lines.hexadecimal(piece.id, 8)
        for flag in (Flag.EXTENDED, Flag.REMOTE, Flag.ERROR):
            lines.put(",1", has(piece, flag)).put(",0", ~has(piece, flag))
        lines.put(",").number(piece.length).put(",")
        # base64: four letters for three bytes, those that nothing stands behind become "="
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
