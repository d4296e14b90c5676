"""Kvaser's three texts, written here as its programs lay them out."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime

import numpy as np
import pytest

from clutchest.can.files import read_frames
from clutchest.can.frames import LENGTH_CODE, Flag, Frames
from clutchest.reading.table_formats import is_table
from samples import random_frames

HEAD = "Chn Identifier Flg   DLC  D0...1...2...3...4...5...6..D7       Time     Dir"
BEGUN = datetime(2021, 7, 21, 11, 7, 12)
BEGUN_NS = round(BEGUN.timestamp()) * 10**9


def sample(fd: bool) -> Frames:
    """Data, remote and error frames, some sent, on two channels, in whole 10 µs of a log."""
    frames = random_frames(300, seed=9, fd=fd)
    flags, length = frames.flags.copy(), frames.length.copy()
    classic = np.flatnonzero((flags & Flag.FD) == 0)
    flags[classic[::5]] |= np.uint8(Flag.REMOTE)
    flags[classic[1::7]], length[classic[1::7]] = Flag.ERROR, 0
    data, can_id = frames.data.copy(), frames.id.copy()
    data[(flags & (Flag.REMOTE | Flag.ERROR)) != 0] = 0
    can_id[(flags & Flag.ERROR) != 0] = 0
    flags[3::4] |= np.uint8(Flag.SENT)
    t_ns = np.sort(frames.t_ns - frames.t_ns.min()) // 10_000 * 10_000
    return replace(
        frames,
        t_ns=t_ns,
        flags=flags,
        length=length,
        id=can_id,
        data=data,
        channel=frames.channel % 2,
        absolute=False,
    )


def rows(frames: Frames):
    for k in range(len(frames)):
        seconds = f"{frames.t_ns[k] // 10**9}.{frames.t_ns[k] % 10**9 // 1000:06d}"
        data = frames.data[k, : frames.length[k]]
        yield (
            k,
            seconds,
            int(frames.channel[k]),
            int(frames.id[k]),
            Flag(int(frames.flags[k])),
            data,
        )


def canking(frames: Frames) -> str:
    lines = [HEAD]
    for k, seconds, channel, can_id, flags, data in rows(frames):
        way = "T" if flags & Flag.SENT else "R"
        if flags & Flag.ERROR:
            lines.append(f" {channel}    00000000            ErrorFrame    {seconds:>20} {way}")
            continue
        letters = ("X" if flags & Flag.EXTENDED else "") + ("R" if flags & Flag.REMOTE else "")
        letters += ("F" if flags & Flag.FD else "") + ("B" if flags & Flag.BITRATE_SWITCH else "")
        letters += "P" if flags & Flag.ERROR_STATE else ""
        cells = "" if flags & Flag.REMOTE else "  ".join(f"{b:02X}" for b in data)
        head = f" {channel}    {can_id:08X} {letters:4}{frames.length[k]:5d}  {cells:30}"
        lines.append(f"{head} {seconds:>14} {way}")
    return "\r\n".join([*lines, "Logging stopped.", ""])


def plain(frames: Frames, base: str = "HEX") -> str:
    lines = [
        "                              Kvaser Memorator Log",
        "                              ====================",
        "",
        f"Memorator Binary logfile created at: {BEGUN:%Y-%m-%d %H:%M:%S}",
        "",
        "Settings:",
        f"   Format of data field: {base}",
        f"   Format of id field:   {base}",
        "   Timestamp Offset:     0.000000           s",
        "   CAN channel:          1 2",
        "",
        "        Time Chan   Identifier Flags        DLC  Data                           Counter",
        "====================================================================================",
        "    0.000000  Trigger (type=0x1, active=0x00, pre-trigger=0, post-trigger=-1)",
        "DateTime:2021-07-21 11:07:13",
    ]
    number = "02X" if base == "HEX" else "3d"
    for k, seconds, channel, can_id, flags, data in rows(frames):
        identifier = f"{can_id:10X}" if base == "HEX" else f"{can_id:10d}"
        identifier = "ErrorFrame" if flags & Flag.ERROR else identifier
        ext = "x" if flags & Flag.EXTENDED else " "
        way = "TxRq" if flags & Flag.SENT and k % 2 else "Tx" if flags & Flag.SENT else "Rx"
        given = (Flag.FD, Flag.BITRATE_SWITCH, Flag.ERROR_STATE, Flag.REMOTE)
        letters = "".join(c if flags & f else " " for c, f in zip("FBPR", given, strict=True))
        code = f"{LENGTH_CODE[frames.length[k]]:3d}" if not flags & Flag.ERROR else "   "
        cells = "".join(f"{b:{number}} " for b in data)
        cells = "RTR" if flags & Flag.REMOTE else "ERROR FRAME" if flags & Flag.ERROR else cells
        lines.append(
            f"{seconds:>12}  {channel + 1}  {identifier}{ext}   {way:5} {letters}  {code}  "
            f"{cells:24} {k + 1:12d}"
        )
    return "\n".join(lines) + "\n"


def csv(frames: Frames, base: str = "DEC", separator: str = ",", mark: str = ".") -> str:
    width = 64 if np.any(frames.flags & Flag.FD) else 8
    names = ["Time", "Channel", "id", "Flags", "DLC", *(f"Data{k}" for k in range(width))]
    lines = [
        "CSV CAN data",
        f"Converted from Kvaser Memorator at{separator}2024-01-01 10:00:00",
        f"Format of data field{separator}{base}",
        f"Format of id field{separator}{base}",
        f"Timestamp Offset{separator}{'0.00000':>20}{separator}seconds",
        f"Logging started at{separator}{BEGUN:%Y-%m-%d %H:%M:%S}",
        separator.join([*names, "Counter", "AbsTime"]),
    ]
    number = "{:x}" if base == "HEX" else "{:d}"
    for k, seconds, channel, can_id, flags, data in rows(frames):
        bits = (4 if flags & Flag.EXTENDED else 2) + (1 if flags & Flag.REMOTE else 0)
        bits += 64 if flags & Flag.SENT else 0
        bits += 0x10000 if flags & Flag.FD else 0
        bits += (0x20000 if flags & Flag.BITRATE_SWITCH else 0) + (
            0x40000 if flags & Flag.ERROR_STATE else 0
        )
        length = int(frames.length[k])
        code = LENGTH_CODE[length]
        cells = [number.format(b) for b in data] if not flags & Flag.REMOTE else ["0"] * length
        start = [number.format(can_id), str(bits), str(code)]
        if flags & Flag.ERROR:
            start, cells = ["", str(34 + (64 if flags & Flag.SENT else 0)), ""], []
        cells += [""] * (width - len(cells))
        line = [seconds.replace(".", mark), str(channel + 1), *start, *cells, str(k + 1)]
        lines.append(separator.join([*line, "2021-07-21 11:07:12"]))
    return "\n".join(lines) + "\n"


def same(given: Frames, expected: Frames) -> None:
    for column in ("t_ns", "channel", "id", "flags", "length"):
        a, b = getattr(given, column), getattr(expected, column)
        np.testing.assert_array_equal(a, b, err_msg=column)
    width = min(given.data.shape[1], expected.data.shape[1])
    np.testing.assert_array_equal(given.data[:, :width], expected.data[:, :width])


@pytest.mark.parametrize("fd", [False, True])
def test_cankings_log(fd, tmp_path):
    frames = sample(fd)
    (tmp_path / "a.txt").write_bytes(canking(frames).encode())
    given = read_frames(tmp_path / "a.txt")
    same(given, frames)
    assert not given.absolute and not given.rejected and not is_table(tmp_path / "a.txt")


@pytest.mark.parametrize("base", ["HEX", "DEC"])
@pytest.mark.parametrize("fd", [False, True])
def test_plain_text(fd, base, tmp_path):
    frames = sample(fd)
    (tmp_path / "a.txt").write_text(plain(frames, base))
    given = read_frames(tmp_path / "a.txt")
    same(given, replace(frames, t_ns=frames.t_ns + BEGUN_NS))
    assert given.absolute and dict(given.rejected) == {"status of the bus, no frame": 1}


@pytest.mark.parametrize("base", ["HEX", "DEC"])
@pytest.mark.parametrize(("separator", "mark"), [(",", "."), (";", ","), ("\t", ".")])
@pytest.mark.parametrize("fd", [False, True])
def test_csv(fd, base, separator, mark, tmp_path):
    frames = sample(fd)
    (tmp_path / "a.csv").write_text(csv(frames, base, separator, mark))
    given = read_frames(tmp_path / "a.csv")
    same(given, replace(frames, t_ns=frames.t_ns + BEGUN_NS))
    assert given.absolute and not given.rejected and not is_table(tmp_path / "a.csv")


def test_what_is_cut_off_or_too_long_is_counted(tmp_path):
    lines = [
        HEAD,
        " 0    00000123         2  01  02       1.000000 R",
        " 0    00000123         3  01  02       1.100000 R",
        " 0    00000123         1  01  02       1.200000 R",
        " 0    00000123         9  01  02  03  04  05  06  07  08       1.300000 R",
        " 0    0000012Z         1  01       1.400000 R",
        " 0    00000123        70" + "  01" * 70 + "       1.500000 R",
        " 0    00000123         1  01       1.6",
        " 0    00000123         2  01  0",
    ]
    (tmp_path / "a.txt").write_text("\n".join(lines))
    frames = read_frames(tmp_path / "a.txt")
    assert frames.t_ns.tolist() == [10**9, 1_300_000_000]
    assert frames.length.tolist() == [2, 8]
    assert sum(dict(frames.rejected).values()) == 6
