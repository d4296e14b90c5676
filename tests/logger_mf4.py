"""MDF4 files as a logger writes them: the description first, the data behind it as they come."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
from asammdf import MDF

from clutchest.can.files import write_frames
from clutchest.can.frames import Frames

PER_BLOCK = 500  # frames


def block(name: bytes, body: bytes, links: int = 0) -> bytes:
    content = struct.pack("<4s4xQQ", name, 24 + len(body), links) + body
    return content + bytes(-len(content) % 8)


def zipped(records: bytes, columns: int = 0) -> bytes:
    """A DZ block; with ``columns`` transposed."""
    content = records
    if columns:
        content = np.frombuffer(records, np.uint8).reshape(-1, columns).T.tobytes()
    packed = zlib.compress(content)
    head = struct.pack("<2sBxIQQ", b"DT", bool(columns), columns, len(records), len(packed))
    return block(b"##DZ", head + packed)


def logged(frames: Frames, path: Path, layout: str) -> tuple[bytes, list[int]]:
    """An MDF4 file as a logger writes it, its description first and its data last, and where the
    data blocks begin."""
    write_frames(frames, path)
    with MDF(path) as mdf:
        plain = mdf.save(path.with_name("plain.mf4"), compression=0)
    content = bytearray(plain.read_bytes())
    (group,) = struct.unpack_from("<Q", content, 64 + 24)
    (data,) = struct.unpack_from("<Q", content, group + 24 + 16)
    (length,) = struct.unpack_from("<Q", content, data + 8)
    assert content[data : data + 4] == b"##DT"
    records = bytes(content[data + 24 : data + length])
    size = len(records) // len(frames)
    content += bytes(-len(content) % 8)
    if layout == "one block":
        struct.pack_into("<Q", content, group + 24 + 16, len(content))
        return bytes(content) + block(b"##DT", records), [len(content)]
    pieces = [records[i : i + PER_BLOCK * size] for i in range(0, len(records), PER_BLOCK * size)]
    make = {
        "list": lambda piece: block(b"##DT", piece),
        "deflated": zipped,
        "transposed": lambda piece: zipped(piece, size),
    }[layout]
    blocks = [make(piece) for piece in pieces]
    n = len(blocks)
    listed = 24 + 8 * (n + 1) + 8 + 8 * n
    struct.pack_into("<Q", content, group + 24 + 16, len(content))
    begins = [int(b) for b in len(content) + listed + np.cumsum([0, *map(len, blocks[:-1])])]
    offsets = [i * PER_BLOCK * size for i in range(n)]
    body = struct.pack(f"<Q{n}QB3xI{n}Q", 0, *begins, 0, n, *offsets)
    return bytes(content) + block(b"##DL", body, n + 1) + b"".join(blocks), begins


def move_channels(path: Path, offset: int) -> None:
    """Let every channel of an MDF4 file begin at byte ``offset`` of its records."""
    content = bytearray(path.read_bytes())
    at = content.find(b"##CN")
    while at >= 0:
        links = int.from_bytes(content[at + 16 : at + 24], "little")
        place = at + 24 + 8 * links + 4
        content[place : place + 4] = offset.to_bytes(4, "little")
        at = content.find(b"##CN", at + 4)
    path.write_bytes(content)
