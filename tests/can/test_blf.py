"""Objects and containers of Vector's binary log, put together by hand."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest

from clutchest.can.files import read_frames, write_frames
from clutchest.can.frames import Flag, Frames
from clutchest.errors import ClutchestError
from samples import random_frames

START_NS = 1_700_668_800_250_000_000  # 22 November 2023, 16:00:00.250 UTC
HEADER = struct.pack(
    "<4sL8B2Q2L8H8H",
    b"LOGG",
    144,
    5,
    0,
    0,
    0,
    2,
    6,
    8,
    1,
    0,
    0,
    0,
    0,
    2023,
    11,
    3,
    22,
    16,
    0,
    0,
    250,
    *(0,) * 8,
).ljust(144, b"\0")


def thing(kind: int, body: bytes, time: int, version: int = 1, unit: int = 2) -> bytes:
    """One object with its padding."""
    stamp = (
        struct.pack("<LHHQ", unit, 0, 0, time)
        if version == 1
        else struct.pack("<LBxHQQ", unit, 0, 0, time, 0)
    )
    size = 16 + len(stamp) + len(body)
    head = struct.pack("<4s2H2L", b"LOBJ", 16 + len(stamp), version, size, kind)
    return head + stamp + body + bytes(size % 4)


def box(content: bytes, method: int = 2) -> bytes:
    packed = zlib.compress(content) if method == 2 else content
    size = 32 + len(packed)
    head = struct.pack("<4s2H2LH6xL4x", b"LOBJ", 16, 1, size, 10, method, len(content))
    return head + packed + bytes(size % 4)


def classic(time: int, can_id: int = 0x123, data: bytes = b"\1\2", **more: int) -> bytes:
    body = struct.pack("<HBBL8s", 2, 0, len(data), can_id, data)
    return thing(1, body, time, **more)


def fd_64(time: int, data: bytes, further: bytes = b"") -> bytes:
    offset = 32 + 40 + len(data) if further else 0
    body = struct.pack(
        "<BBBBLLLLLLLHBBL", 3, 13, len(data), 0, 0x98FEF100, 0, 0x7000, 0, 0, 0, 0, 0, 1, offset, 0
    )
    return thing(101, body + data + further, time)


def read(content: bytes, tmp_path: Path) -> Frames:
    (tmp_path / "a.blf").write_bytes(HEADER + content)
    return read_frames(tmp_path / "a.blf")


def test_every_object_that_carries_a_frame(tmp_path):
    wide = bytes(range(32))
    content = b"".join(
        [
            classic(1_000),
            thing(86, struct.pack("<HBBL8sLBBH", 1, 0x81, 4, 0x98FEF100, b"", 0, 0, 0, 0), 2_000),
            thing(65, b"text that is no frame!", 2_500),
            thing(100, struct.pack("<HBBLLBBB5x64s", 1, 1, 13, 5, 0, 0, 3, 32, wide), 3_000),
            fd_64(4_000, wide),
            fd_64(5_000, wide[:20], further=b"extended data"),
            thing(2, struct.pack("<HHL", 4, 0, 0), 6_000),
            thing(73, struct.pack("<HHLBBBxLLH2x8s", 5, 0, 0, 0, 0, 2, 0, 7, 0, b"\5\6"), 7_000),
            thing(104, bytes([6]) + bytes(47), 8_000),
            classic(9, version=2, unit=1),
        ]
    )
    frames = read(box(content), tmp_path)
    assert frames.rejected == () and frames.absolute
    assert (frames.t_ns - START_NS).tolist() == [*range(1_000, 9_000, 1_000), 90_000]
    assert frames.channel.tolist() == [1, 0, 0, 2, 2, 3, 4, 5, 1]
    assert frames.id.tolist() == [0x123, 0x18FEF100, 5, 0x18FEF100, 0x18FEF100, 0, 7, 0, 0x123]
    assert frames.length.tolist() == [2, 4, 32, 32, 20, 0, 2, 0, 2]
    fd = Flag.FD | Flag.BITRATE_SWITCH | Flag.SENT
    full = fd | Flag.ERROR_STATE | Flag.EXTENDED
    assert frames.flags.tolist() == [
        0,
        Flag.EXTENDED | Flag.REMOTE | Flag.SENT,
        fd,
        full,
        full,
        Flag.ERROR,
        Flag.ERROR,
        Flag.ERROR | Flag.FD,
        0,
    ]
    assert frames.data[2, :32].tobytes() == frames.data[3, :32].tobytes() == wide
    assert frames.data[4, :21].tobytes() == wide[:20] + b"\0"


@pytest.mark.parametrize(
    "wrap",
    [
        lambda a, b: a + b,  # loose
        lambda a, b: box(a + b, method=0),
        lambda a, b: box((a + b)[:60]) + box((a + b)[60:]),  # an object in two containers
        lambda a, b: box(a + box(b)),
        lambda a, b: box(box(box((a + b)[:60])) + box(box((a + b)[60:]), method=0)),
    ],
    ids=["loose", "stored", "divided", "nested", "nested and divided"],
)
def test_containers(wrap, tmp_path):
    a = classic(1_000, data=b"\1\2\3") + classic(2_000)
    b = fd_64(3_000, b"\7" * 12) + classic(4_000)
    frames = read(wrap(a, b), tmp_path)
    assert (frames.t_ns - START_NS).tolist() == [1_000, 2_000, 3_000, 4_000]
    assert frames.length.tolist() == [3, 2, 12, 2] and frames.rejected == ()


def test_damage_in_the_middle_costs_what_it_hits(tmp_path):
    frames = random_frames(20_000, seed=31)
    write_frames(frames, tmp_path / "a.blf")
    content = bytearray((tmp_path / "a.blf").read_bytes())
    content[len(content) // 2] ^= 0xFF
    (tmp_path / "a.blf").write_bytes(content)
    given = read_frames(tmp_path / "a.blf")
    assert given.rejected and len(given) > 0.75 * len(frames)
    known = set(zip(frames.t_ns.tolist(), frames.id.tolist(), strict=True))
    found = list(zip(given.t_ns.tolist(), given.id.tolist(), strict=True))
    assert np.mean([pair in known for pair in found]) > 0.999


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (struct.pack("<4s2H2L", b"LOBJ", 16, 1, 0xFFFFFFF0, 10) + bytes(40), "damaged"),
        (struct.pack("<4s2H2L", b"LOBJ", 16, 1, 0, 1) + bytes(40), "damaged"),
        (box(struct.pack("<4s2H2L", b"LOBJ", 16, 1, 0x7FFFFFFF, 1) + bytes(40)), "damaged"),
        (box(bytes(20 << 20)), "container holds more than 16 MiB"),
        (box(b"LOBJ" * 1000), "damaged"),
        (box(classic(1))[:-9], "ends early"),
        (struct.pack("<4s2H2LH6xL4x", b"LOBJ", 16, 1, 36, 10, 7, 0) + bytes(4), "unknown way"),
    ],
)
def test_what_claims_too_much_is_refused(content, reason, tmp_path):
    frames = read(box(classic(5)) + content + box(classic(6)), tmp_path)
    assert set((frames.t_ns - START_NS).tolist()) >= {5}
    assert any(reason in why for why, _ in frames.rejected)


def test_containers_all_the_way_down_end(tmp_path):
    content = classic(1)
    for _ in range(12):
        content = box(content)
    with pytest.raises(ClutchestError, match="containers within containers"):
        read(content, tmp_path)
    bomb = box(bytes(15 << 20), method=2)
    many = box(bomb * 50)
    frames = read(box(classic(5)) + many, tmp_path)
    assert len(frames) == 1
    assert ("containers within containers hold too much", 46) in frames.rejected
