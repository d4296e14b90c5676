"""Files that claim, or unpack to, more than there is memory; and what stands in such files."""

from __future__ import annotations

import gzip
import struct
import tracemalloc
import zlib
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest

from clutchest.can import log_source
from clutchest.can.files import read_frames, write_frames
from clutchest.errors import ClutchestError
from logger_mf4 import logged, move_channels
from samples import random_frames

GOOD = b"(1436509052.249713) can0 123#0102\n"
MIB = 1 << 20


@contextmanager
def within(mebibytes: float) -> Iterator[None]:
    """Fails if more than that is taken at any moment."""
    tracemalloc.start()
    try:
        yield
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < mebibytes * MIB


def deflated(start: bytes, filling: bytes, count: int, **options: int) -> bytes:
    """``start`` and many times ``filling``, packed without ever being in memory."""
    packer = zlib.compressobj(9, **options)
    parts = [packer.compress(start)] + [packer.compress(filling) for _ in range(count)]
    return b"".join(parts) + packer.flush()


@pytest.fixture(scope="module", autouse=True)
def compiled(tmp_path_factory):
    path = tmp_path_factory.mktemp("first") / "a.log"
    for suffix in (".log", ".blf"):
        write_frames(random_frames(5, seed=1), path.with_suffix(suffix))
        read_frames(path.with_suffix(suffix))


@pytest.mark.parametrize("filling", [b"\0", b" ", b"\n"], ids=["zeros", "blanks", "newlines"])
def test_a_gzip_that_unpacks_to_much_more(filling, tmp_path, monkeypatch):
    monkeypatch.setattr(log_source, "HOPELESS", 30)
    path = tmp_path / "a.log.gz"
    path.write_bytes(deflated(GOOD, filling * MIB, 60, wbits=31))
    assert path.stat().st_size < MIB // 8
    with within(20):
        frames = read_frames(path)
    assert len(frames) == 1
    assert ("nothing readable for long, the rest left unread", 1) in frames.rejected


def test_a_gzip_of_nothing_readable_is_refused_at_once(tmp_path):
    path = tmp_path / "a.log.gz"
    path.write_bytes(deflated(b"", b"\0" * MIB, 60, wbits=31))
    with pytest.raises(ClutchestError):
        read_frames(path)  # what is imported and compiled for it once is not the file's doing
    with within(20), pytest.raises(ClutchestError):
        read_frames(path)


def test_a_whole_read_format_in_a_gzip_has_a_limit(tmp_path, monkeypatch):
    from clutchest.can.formats import mf4

    monkeypatch.setattr(mf4, "UNPACKED_BYTES", 10 * MIB)
    path = tmp_path / "a.mf4.gz"
    path.write_bytes(deflated(b"MDF     4.10    ", b"\0" * MIB, 40, wbits=31))
    with within(35), pytest.raises(ClutchestError, match=r"more than 10 MiB.*unpack it first"):
        read_frames(path)


@pytest.mark.parametrize("length", [10 * MIB, 3 * MIB, MIB + 1])
def test_a_line_of_mebibytes_costs_only_itself(length, tmp_path):
    path = tmp_path / "a.log"
    path.write_bytes(GOOD + b"(1.5) can0 123#" + b"0" * length + b"\n" + GOOD + GOOD[:-1])
    with within(20):
        frames = read_frames(path)
    assert len(frames) == 3
    assert frames.rejected == (("line longer than 1 MiB", 1),)


def test_lines_go_on_across_blocks(tmp_path, monkeypatch):
    frames = random_frames(500, seed=2)
    write_frames(frames, tmp_path / "a.log")
    for block in (60, 61, 64, 97, 1000):
        monkeypatch.setattr(log_source, "BLOCK", block)
        given = read_frames(tmp_path / "a.log")
        np.testing.assert_array_equal(given.t_ns, frames.t_ns)
        np.testing.assert_array_equal(given.data, frames.data)
        assert given.rejected == ()


def test_a_container_that_unpacks_to_much_more(tmp_path):
    frames = random_frames(100, seed=3)
    write_frames(frames, tmp_path / "a.blf")
    packed = deflated(b"", b"\0" * MIB, 120)
    size = 32 + len(packed)
    bomb = struct.pack("<4s2H2LH6xL4x", b"LOBJ", 16, 1, size, 10, 2, 1000) + packed
    content = (tmp_path / "a.blf").read_bytes()
    path = tmp_path / "b.blf"
    path.write_bytes(content + bomb + bytes(size % 4) + content[144:])
    with within(80):
        given = read_frames(path)
    assert len(given) == 200
    assert given.rejected == (("container holds more than 16 MiB", 1),)


def test_many_empty_gzip_members_end(tmp_path):
    path = tmp_path / "a.log.gz"
    path.write_bytes(gzip.compress(GOOD) + gzip.compress(b"") * 50_000 + gzip.compress(GOOD))
    assert len(read_frames(path)) == 2


def test_a_log_of_nothing_but_headers_ends_soon(tmp_path):
    path = tmp_path / "a.asc"
    path.write_bytes(b"date \nbase hex\nbegin \n" * 100_000 + b"1.5 1  123  Rx  d 1 07\n")
    frames = read_frames(path)
    assert frames.id.tolist() == [0x123]
    assert frames.rejected == (("no CAN frame in this line", 290_000),)


@pytest.mark.parametrize("offset", [40, 0x7FFFFFFF, 0xFFFFFFFF])
def test_an_mf4_channel_beyond_its_records(offset, tmp_path):
    """asammdf would read there, whatever memory that is."""
    path = tmp_path / "a.mf4"
    write_frames(random_frames(100, seed=3), path)
    move_channels(path, offset)
    with pytest.raises(ClutchestError, match="ends beyond its records"):
        read_frames(path)


def test_an_mf4_whose_records_are_giants(tmp_path):
    """asammdf would make room for one of them."""
    path = tmp_path / "a.mf4"
    content = bytearray(logged(random_frames(100, seed=3), path, "deflated")[0])
    at = content.find(b"##CG")
    content[at + 8 : at + 16] = bytes(8)  # no length: what stands in the block is read elsewhere
    path.write_bytes(content)
    with within(20), pytest.raises(ClutchestError, match=r"records of \d+ bytes"):
        read_frames(path)
