"""Logs without the head that names their format, as ``split`` and ``tail`` leave them, and csv
whose header somebody has changed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from clutchest.can.files import read_frames, write_frames
from clutchest.can.frames import Flag, Frames
from samples import random_frames

S = 10**9


def read(folder: Path, text: str, name: str) -> Frames:
    (folder / name).write_text(text)
    return read_frames(folder / name)


def same_but_for_the_date(given: Frames, expected: Frames) -> None:
    steps = np.diff(given.t_ns), np.diff(expected.t_ns)
    np.testing.assert_allclose(*steps, atol=1000)
    for column in ("id", "flags", "length", "channel"):
        np.testing.assert_array_equal(getattr(given, column), getattr(expected, column), column)
    assert not given.absolute


@pytest.mark.parametrize("fd", [False, True])
def test_a_piece_of_an_asc(fd, tmp_path):
    frames = random_frames(200, seed=4, fd=fd).sorted()
    write_frames(frames, tmp_path / "whole.asc")
    lines = (tmp_path / "whole.asc").read_text().splitlines()
    first = next(k for k, line in enumerate(lines) if " d " in line)
    piece = lines[first + 20 :]
    given = read(tmp_path, "\n".join(piece), "piece.asc")
    same_but_for_the_date(given, frames.take(np.arange(len(frames) - len(given), len(frames))))
    assert len(given) >= 170


TRC = {
    "1.0": "{n:6d}) {ms:9.0f}  {id}  {length}  {data}",
    "1.1": "{n:6d}) {ms:11.1f}  {way}  {id:>11}  {length}  {data}",
    "1.2": "{n:6d}) {ms:13.3f} {bus}  {way}  {id:>8}  {length}  {data}",
    "1.3": "{n:6d}) {ms:13.3f} {bus}  {way}  {id:>8} -  {length}  {data}",
}


@pytest.mark.parametrize("version", TRC)
def test_a_piece_of_a_trc(version, tmp_path):
    frames = random_frames(50, seed=6).sorted()
    t_ns = (np.arange(len(frames)) * 7 + 3) * 1_000_000
    frames = replace(frames, t_ns=t_ns, flags=frames.flags & np.uint8(Flag.EXTENDED | Flag.SENT))
    frames = replace(frames, channel=frames.channel % 2)
    lines = []
    for n in range(len(frames)):
        wide = frames.flags[n] & Flag.EXTENDED
        lines.append(
            TRC[version].format(
                n=n + 900,
                ms=t_ns[n] / 1e6,
                way="Tx" if frames.flags[n] & Flag.SENT else "Rx",
                id=f"{frames.id[n]:08X}" if wide else f"{frames.id[n]:04X}",
                bus=frames.channel[n] + 1,
                length=frames.length[n],
                data=bytes(frames.data[n, : frames.length[n]]).hex(" "),
            )
        )
    given = read(tmp_path, "\n".join(lines), "piece.trc")
    ways, buses = version != "1.0", version in ("1.2", "1.3")
    expected = replace(
        frames,
        flags=frames.flags if ways else frames.flags & np.uint8(Flag.EXTENDED),
        channel=frames.channel if buses else frames.channel * 0,
    )
    same_but_for_the_date(given, expected)


CHANGED = {
    "Time Stamp, ID, Extended, Dir, Bus, LEN, D1, D2\n16, 123, false, Tx, 0, 2, 01, FF\n": 16_000,
    "Time Stamp;ID;Extended;Dir;Bus;LEN;D1;D2\n16;00000123;false;Tx;0;2;01;FF\n": 16_000,
    "timestamp, arbitration id, extended, remote, error, dlc, data\n0.5,0x123,0,0,0,2,Af8=\n": S
    // 2,
    "No.;Time Offset (ms);Type;ID;Data Length;Data\n1;1.5;DT;123;2;01 FF\n": 1_500_000,
    "frame.time_epoch\tcan.id\tcan.len\tdata.data\n1700000000.5\t291\t2\t01:ff\n": 17 * 10**17
    + S // 2,
    "frame.time_relative,can.id,can.flags.xtd,can.len,data.data\n0.5,291,False,2,01ff\n": S // 2,
}


@pytest.mark.parametrize("text", CHANGED)
def test_headers_as_others_write_them(text, tmp_path):
    frames = read(tmp_path, text, "a.csv")
    assert frames.t_ns.tolist() == [CHANGED[text]] and frames.id.tolist() == [0x123]
    assert bytes(frames.data[0, :2]) == b"\x01\xff" and frames.length.tolist() == [2]


def test_candump_stamps_in_whole_seconds(tmp_path):
    frames = read(tmp_path, "(1700000000) can0 123#01\n(1700000001) can0 123#02\n", "a.log")
    assert frames.t_ns.tolist() == [1_700_000_000 * S, 1_700_000_001 * S] and frames.absolute
