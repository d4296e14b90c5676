"""Vector's binary log: CAN_MESSAGE, CAN_FD_MESSAGE and CAN_ERROR_EXT in zlib containers."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from clutchest.can.frames import LENGTH_CODE, Flag, Frames
from clutchest.can.text_lines import has, pieces

_HEADER = struct.Struct("<4sL8B2Q2L8H8H")
_HEADER_SIZE = 144
_CONTAINER = 128 << 10  # bytes, before compression
_OBJECT = [
    ("mark", "S4"),
    ("header", "<u2"),
    ("version", "<u2"),
    ("size", "<u4"),
    ("type", "<u4"),
    ("unit", "<u4"),
    ("client", "<u2"),
    ("object", "<u2"),
    ("time", "<u8"),
]
_MESSAGE = np.dtype(
    [
        *_OBJECT,
        ("channel", "<u2"),
        ("flags", "u1"),
        ("code", "u1"),
        ("id", "<u4"),
        ("data", "u1", 8),
    ]
)
_FD = np.dtype(
    [
        *_OBJECT,
        ("channel", "<u2"),
        ("flags", "u1"),
        ("code", "u1"),
        ("id", "<u4"),
        ("duration", "<u4"),
        ("bits", "u1"),
        ("modes", "u1"),
        ("length", "u1"),
        ("reserved", "u1", 5),
        ("data", "u1", 64),
    ]
)
_ERROR = np.dtype(
    [
        *_OBJECT,
        ("channel", "<u2"),
        ("length", "<u2"),
        ("flags", "<u4"),
        ("ecc", "u1"),
        ("position", "u1"),
        ("code", "u1"),
        ("reserved", "u1"),
        ("duration", "<u4"),
        ("id", "<u4"),
        ("ext", "<u2"),
        ("reserved2", "<u2"),
        ("data", "u1", 8),
    ]
)


def write(frames: Frames, path: Path) -> None:
    """Writes the log.  Without a date in the header its times count from zero."""
    start_ms = 0
    if frames.absolute and len(frames):
        start_ms = int(frames.t_ns.min()) // 10**6
    last_ms = int(frames.t_ns.max(initial=0)) // 10**6 if frames.absolute else 0
    with path.open("wb") as file:
        file.write(bytes(_HEADER_SIZE))
        size = _HEADER_SIZE
        for content in _containers(_objects(piece, start_ms * 10**6) for piece in pieces(frames)):
            packed = zlib.compress(content)
            length = 32 + len(packed)
            file.write(struct.pack("<4s2H2LH6xL4x", b"LOBJ", 16, 1, length, 10, 2, len(content)))
            file.write(packed + bytes(length % 4))
            size += 32 + len(content)
        total = file.tell()
        file.seek(0)
        file.write(
            _HEADER.pack(
                b"LOGG",
                _HEADER_SIZE,
                5,
                0,
                0,
                0,
                2,
                6,
                8,
                1,
                total,
                size,
                len(frames),
                0,
                *_systemtime(start_ms),
                *_systemtime(last_ms),
            )
        )


def _systemtime(ms: int) -> tuple[int, ...]:
    if not ms:
        return (0,) * 8
    t = datetime.fromtimestamp(ms // 1000, UTC)
    return t.year, t.month, t.isoweekday() % 7, t.day, t.hour, t.minute, t.second, ms % 1000


def _containers(parts: Iterator[bytes]) -> Iterator[bytes]:
    rest = b""
    for part in parts:
        rest += part
        while len(rest) >= _CONTAINER:
            yield rest[:_CONTAINER]
            rest = rest[_CONTAINER:]
    if rest:
        yield rest


def _objects(frames: Frames, start_ns: int) -> bytes:
    error = has(frames, Flag.ERROR)
    fd = has(frames, Flag.FD) & ~error
    kinds = ((~(fd | error), _MESSAGE, 1), (fd, _FD, 100), (error, _ERROR, 73))
    sizes = np.select([fd, error], [_FD.itemsize, _ERROR.itemsize], _MESSAGE.itemsize)
    offsets = np.cumsum(sizes) - sizes
    content = np.zeros(int(sizes.sum()), np.uint8)
    for rows, layout, number in kinds:
        if rows.any():
            chosen = _object(frames.take(rows), start_ns, layout, number)
            places = offsets[rows][:, None] + np.arange(layout.itemsize)
            content[places] = chosen.view(np.uint8).reshape(len(chosen), -1)
    return content.tobytes()


def _object(frames: Frames, start_ns: int, layout: np.dtype, number: int) -> NDArray:
    objects = np.zeros(len(frames), layout)
    objects["mark"], objects["header"], objects["version"] = b"LOBJ", 32, 1
    objects["size"], objects["type"], objects["unit"] = layout.itemsize, number, 2  # ns
    objects["time"] = frames.t_ns - start_ns
    objects["channel"] = frames.channel.astype(np.uint16) + 1
    objects["id"] = frames.id | has(frames, Flag.EXTENDED) * np.uint32(0x80000000)
    objects["code"] = LENGTH_CODE[frames.length] if layout is _FD else frames.length
    width = objects["data"].shape[1]
    objects["data"][:, : frames.data.shape[1]] = frames.data[:, :width]
    if layout is not _ERROR:
        objects["flags"] = has(frames, Flag.SENT) + has(frames, Flag.REMOTE) * np.uint8(0x80)
    if layout is _FD:
        objects["length"] = frames.length
        modes = ((Flag.FD, 1), (Flag.BITRATE_SWITCH, 2), (Flag.ERROR_STATE, 4))
        objects["modes"] = sum(has(frames, flag) * np.uint8(bit) for flag, bit in modes)
    return objects
