from __future__ import annotations

import time
from datetime import datetime
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest

import can
from clutchest.can import log_source
from clutchest.can.files import read_frames
from clutchest.can.formats import candump
from clutchest.can.frames import Flag, Frames
from clutchest.can.log_source import LogSource
from clutchest.errors import ClutchestError
from samples import random_frames


def read(content: bytes) -> Frames:
    return Frames.concatenate(list(candump.read(LogSource(Path("a.log"), BytesIO(content)))))


def rows(frames: Frames) -> list[tuple]:
    return [
        (int(t), int(c), int(i), Flag(int(f)), bytes(d[:n]) if not f & Flag.REMOTE else int(n))
        for t, c, i, f, n, d in zip(
            frames.t_ns,
            frames.channel,
            frames.id,
            frames.flags,
            frames.length,
            frames.data,
            strict=True,
        )
    ]


def test_compact_layout_by_hand():
    frames = read(
        b"(1436509052.249713) vcan12 123#0102aB\n"
        b"(1436509052.249714) can0 18FEF100#FFFFFFFFFFFFFFFF R\r\n"
        b"(1436509053.123456789) can1 00000123# T\n"
        b"\n"
        b"(1436509053.2) can0 7FF#R\n"
        b"(1436509053.200001) can0 1ABCDEF0#R4\n"
        b"(1436509053.200002) can0 20000080#0000000000000000\n"
        b"(1436509053.200003) can0 123#11223344_9\n"
        b"(1436509053.200004) can0 123#R8_B"
    )
    s = 1436509053 * 10**9
    assert rows(frames) == [
        (s - 750287000, 12, 0x123, Flag(0), b"\x01\x02\xab"),
        (s - 750286000, 0, 0x18FEF100, Flag.EXTENDED, b"\xff" * 8),
        (s + 123456789, 1, 0x123, Flag.EXTENDED | Flag.SENT, b""),
        (s + 200000000, 0, 0x7FF, Flag.REMOTE, 0),
        (s + 200001000, 0, 0x1ABCDEF0, Flag.EXTENDED | Flag.REMOTE, 4),
        (s + 200002000, 0, 0x80, Flag.ERROR, bytes(8)),
        (s + 200003000, 0, 0x123, Flag(0), b"\x11\x22\x33\x44"),
        (s + 200004000, 0, 0x123, Flag.REMOTE, 8),
    ]
    assert frames.absolute and frames.rejected == () and frames.data.shape[1] == 8


def test_fd_frames_widen_the_payload():
    frames = read(
        b"(1.5) can0 123#01\n(1.6) can0 18FF1003##3" + b"AB" * 64 + b"\n(1.7) can0 124##0\n"
    )
    assert rows(frames) == [
        (1_500_000_000, 0, 0x123, Flag(0), b"\x01"),
        (
            1_600_000_000,
            0,
            0x18FF1003,
            Flag.EXTENDED | Flag.FD | Flag.BITRATE_SWITCH | Flag.ERROR_STATE,
            b"\xab" * 64,
        ),
        (1_700_000_000, 0, 0x124, Flag.FD, b""),
    ]
    assert frames.data.shape == (3, 64) and not frames.absolute


def test_console_layout_by_hand():
    frames = read(
        b" (000.000000)  can0  18FCF200   [8]  E1 FF FF FF FF FF FF FF\n"
        b" (000.005001)  can0       123   [2]  0a 0B   '..'\n"
        b" (000.005002)  can0  123   [0] \n"
        b" (000.005003)  can0  123   [3]  remote request\n"
        b" (000.005004)  can0  20000080   [8]  00 00 00 00 00 00 00 00   ERRORFRAME\n"
        b" (000.005005)  can1  TX - -  123   [1]  7F\n"
        b" (000.005006)  can1  RX B -  124  [12]  00 01 02 03 04 05 06 07 08 09 0A 0B\n"
    )
    assert rows(frames) == [
        (0, 0, 0x18FCF200, Flag.EXTENDED, b"\xe1" + b"\xff" * 7),
        (5_001_000, 0, 0x123, Flag(0), b"\x0a\x0b"),
        (5_002_000, 0, 0x123, Flag(0), b""),
        (5_003_000, 0, 0x123, Flag.REMOTE, 3),
        (5_004_000, 0, 0x80, Flag.ERROR, bytes(8)),
        (5_005_000, 1, 0x123, Flag.SENT, b"\x7f"),
        (5_006_000, 1, 0x124, Flag.FD | Flag.BITRATE_SWITCH, bytes(range(12))),
    ]
    assert not frames.absolute


GOOD = b"(1.000000) can0 123#0102\n"


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        (b"# a comment", "no CAN frame"),
        (b"(12x.5) can0 123#01", "time stamp cannot be read"),
        (b"(.5) can0 123#01", "time stamp cannot be read"),
        (b"(99999999999.5) can0 123#01", "time stamp cannot be read"),
        (b"(1.5", "time stamp cannot be read"),
        (b"(1.5) can0 12#01", "id is not"),
        (b"(1.5) can0 FFF#01", "id is not"),
        (b"(1.5) can0", "id is not"),
        (b"(1.5) can0 12G#01", "id is not"),
        (b"(1.5) can0 123#0", "payload cannot"),
        (b"(1.5) can0 123#0G", "payload cannot"),
        (b"(1.5) can0 123#010203040506070809", "payload cannot"),
        (b"(1.5) can0 123##", "payload cannot"),
        (b"(1.5) can0 123###00", "payload cannot"),
        (b"(1.5) can0 123#01 X", "payload cannot"),
        (b"(1.5) can0 123 [8] 01 02", "payload is shorter"),
        (b"(1.5) can0 123 [2] 01 0", "payload is shorter"),
        (b"(1.5) can0 123 [9] 01 02 03 04 05 06 07 08 09", "payload cannot"),
        (b"(1.5) can0 123 [2] 01 0Z", "payload cannot"),
        (b"(1.5) can0 123 [2] 01 023", "payload cannot"),
        (b"(1.5) can0 123 2", "id is not"),
    ],
)
def test_a_broken_line_is_counted_and_the_rest_kept(line, reason):
    frames = read(GOOD + line + b"\n" + GOOD + line)
    assert rows(frames) == rows(read(GOOD + GOOD))
    ((given, count),) = frames.rejected
    assert given.startswith(reason) and count == 2


def test_nothing_of_a_broken_line_stays_behind():
    frames = read(b"(1.5) can0 123#01020304050G\n(1.6) can0 124#09\n")
    assert frames.data.tolist() == [[9, 0, 0, 0, 0, 0, 0, 0]]


def test_agrees_with_python_can(tmp_path):
    """Both read what the other wrote."""
    frames = random_frames(500, seed=1, fd=True)
    path = tmp_path / "ours.log"
    path.write_bytes(b"".join(candump.write(frames)))
    back_path = tmp_path / "back.log"
    with can.CanutilsLogReader(path) as reader, can.CanutilsLogWriter(back_path) as back:
        messages = list(reader)
        for message in messages:
            back.on_message_received(message)
    assert len(messages) == len(frames)
    for i, message in enumerate(messages):
        assert message.arbitration_id == frames.id[i]
        assert message.is_extended_id == bool(frames.flags[i] & Flag.EXTENDED)
        assert message.is_fd == bool(frames.flags[i] & Flag.FD)
        assert message.bitrate_switch == bool(frames.flags[i] & Flag.BITRATE_SWITCH)
        assert bytes(message.data) == frames.data[i, : frames.length[i]].tobytes()
        assert round(message.timestamp * 1e6) * 1000 == frames.t_ns[i]
    assert rows(read_frames(back_path)) == rows(frames)


def test_nanoseconds_are_kept():
    frames = random_frames(20, seed=2)
    frames.t_ns[:] += np.arange(20) * 37
    assert rows(read(b"".join(candump.write(frames)))) == rows(frames)


@pytest.mark.parametrize("unit", [1, 1000])
def test_a_few_frames_are_written_as_many_are(unit):
    """A live session writes frames one by one, a converted log column by column."""
    n, rng = 200, np.random.default_rng(1)
    frames = Frames(
        1_700_000_000_000_000_000 + np.cumsum(rng.integers(1, 10**9, n)) // unit * unit,
        rng.integers(0, 3, n).astype(np.uint8),
        rng.integers(0, 0x7FF, n).astype(np.uint32) << np.uint32(18 * (unit > 1)),
        np.full(n, Flag.EXTENDED if unit > 1 else 0, np.uint8),
        rng.integers(0, 9, n).astype(np.uint8),
        rng.integers(0, 256, (n, 8)).astype(np.uint8),
    )
    together = b"".join(candump.write(frames))
    each = [b"".join(candump.write(frames.take(slice(k, k + 20)))) for k in range(0, n, 20)]
    assert b"".join(each) == together


def local_ns(*date: int) -> int:
    return round(datetime(*date).timestamp() * 1e6) * 1000


def test_dates_are_local_time():
    frames = read(
        b" (2019-02-28 23:59:59.999999)  can1  57E   [2]  C7 35\n"
        b" (2019-03-01 00:00:00.000001)  can1  18FEF100   [1]  9A\n"
        b" (2020-02-29 12:00:00.5)  can0  123   [0]\n"
        b" (2020-12-31 06:07:08.090807)  can0  123   [1]  01\n"
        b" (2020-13-01 06:07:08.090807)  can0  123   [1]  02\n"
        b" (2020-12-1 06:07:08.090807)  can0  123   [1]  03\n"
        b" (12.5)  can0  123   [1]  04\n"
    )
    assert frames.t_ns.tolist() == [
        local_ns(2019, 2, 28, 23, 59, 59, 999999),
        local_ns(2019, 3, 1, 0, 0, 0, 1),
        local_ns(2020, 2, 29, 12, 0, 0, 500000),
        local_ns(2020, 12, 31, 6, 7, 8, 90807),
    ]
    assert frames.absolute and frames.rejected == (("time stamp cannot be read", 3),)
    assert frames.id.tolist() == [0x57E, 0x18FEF100, 0x123, 0x123]


@pytest.mark.skipif(not hasattr(time, "tzset"), reason="needs POSIX time zones")
def test_dates_through_the_change_of_summer_time(monkeypatch):
    monkeypatch.setenv("TZ", "CET-1CEST,M3.5.0,M10.5.0/3")
    time.tzset()
    try:
        frames = read(
            b" (2021-03-28 01:30:00.000000)  can0  123   [0]\n"
            b" (2021-03-28 03:30:00.000000)  can0  123   [0]\n"
            b" (2021-07-01 12:00:00.000000)  can0  123   [0]\n"
        )
    finally:
        monkeypatch.undo()
        time.tzset()
    s = [1_616_891_400, 1_616_895_000, 1_625_133_600]
    assert frames.t_ns.tolist() == [t * 10**9 for t in s]


@pytest.mark.parametrize("first", [0, 7_000_000])
def test_stamps_since_the_frame_before_are_added_up(first, monkeypatch):
    rng = np.random.default_rng(5)
    steps = np.r_[first, 10_000_000 + rng.integers(-400, 400, 3000) * 1000]
    lines = [f" ({t // 10**9:03d}.{t % 10**9 // 1000:06d})  can0  1F0   [1]  07\n" for t in steps]
    lines[1500] = lines[1500].replace("[1]", "[x]")  # its time counts all the same
    monkeypatch.setattr(log_source, "BLOCK", 10_000)
    frames = read("".join(lines).encode())
    assert frames.t_ns.tolist() == np.delete(np.cumsum(steps), 1500).tolist()
    assert not frames.absolute


def test_stamps_of_equal_periods_are_added_up():
    lines = [b" (000.000000)  can0  1F0   [0]\n", *[b" (000.020000)  can0  1F0   [0]\n"] * 5]
    assert read(b"".join(lines)).t_ns.tolist() == [k * 20_000_000 for k in range(6)]


def test_stamps_since_the_first_frame_are_taken_as_they_are():
    us = np.r_[0, np.cumsum(np.random.default_rng(6).integers(1, 300, 500))]
    us[250] -= 400  # once out of order
    lines = [f" ({t // 10**6:03d}.{t % 10**6:06d})  can0  1F0   [0]\n" for t in us]
    assert read("".join(lines).encode()).t_ns.tolist() == (us * 1000).tolist()


def test_bytes_that_are_swapped_or_in_bits():
    """-S, -i and both; a single byte looks the same."""
    frames = read(
        b" (1.000001)  can0  123   [3]  33`22`11\n"
        b" (1.000002)  can0  123   [3]  33`22`11   '3\"`'\n"
        b" (1.000003)  can0  00000123   [1]  7F\n"
        b" (1.000004)  can0  123   [2]  00010001 10000010\n"
        b" (1.000005)  can0  123   [2]  10000010`00010001\n"
        b" (1.000006)  can0  123  [12]  " + b"`".join(b"%02X" % k for k in range(12, 0, -1)) + b"\n"
        b" (1.000007)  can0  123   [0]\n"
        b" (1.000008)  can0  123   [3]  22`11\n"
        b" (1.000009)  can0  123   [2]  00010001\n"
        b" (1.000010)  can0  123   [2]  33`2\n"
        b" (1.000011)  can0  123   [2]  33`22`11\n"
        b" (1.000012)  can0  123   [2]  00010001 1000001"
    )
    assert [bytes(d[:n]) for d, n in zip(frames.data, frames.length, strict=True)] == [
        b"\x11\x22\x33",
        b"\x11\x22\x33",
        b"\x7f",
        b"\x11\x82",
        b"\x11\x82",
        bytes(range(1, 13)),
        b"",
    ]
    assert sum(count for _, count in frames.rejected) == 5


@pytest.mark.parametrize(
    "line",
    [
        "  can0  18FEF100   [8]  00 11 22 33 44 55 66 77",
        "vcan1 123#1122",
        "  can0  TX - -  7FF [0] ",
    ],
)
def test_a_log_without_time_stamps_says_how_to_record_one(line, tmp_path):
    (tmp_path / "a.log").write_text(f"{line}\n" * 5)
    with pytest.raises(ClutchestError, match=r"a\.log: a candump without time stamps.*candump -l"):
        read_frames(tmp_path / "a.log")
