"""Every format against python-can, frame for frame and in both directions."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

import can
from clutchest.can.files import read_frames, write_frames
from clutchest.can.frames import Flag, Frames
from samples import random_frames

FULL = (".log", ".asc", ".blf")  # hold everything
READERS = {
    ".log": can.CanutilsLogReader,
    ".asc": lambda path: can.ASCReader(path, relative_timestamp=False),
    ".blf": can.BLFReader,
    ".trc": can.TRCReader,
    ".csv": can.CSVReader,
    ".mf4": can.MF4Reader,
    ".db": can.SqliteReader,
}


def mixture(suffix: str, n: int, seed: int) -> Frames:
    """Frames of every kind that python-can's writer of a format keeps."""
    frames = random_frames(n, seed, fd=suffix in (*FULL, ".mf4"))
    fd = (frames.flags & Flag.FD) != 0
    frames.length[fd & (frames.length == 0)] = 1  # python-can takes these for remote frames
    classic = np.flatnonzero(~fd)
    if suffix in (*FULL, ".csv"):
        frames.flags[classic[::3]] |= np.uint8(Flag.REMOTE)
        frames.data[classic[::3]] = 0
        if suffix == ".log":
            frames.length[classic[::3]] = 0  # its writer forgets it
        error = classic[1::3]
        frames.flags[error], frames.length[error] = Flag.ERROR, 0
        frames.id[error] = 0x80 if suffix == ".log" else 0  # the class that python-can knows
        frames.data[error] = 0
    if suffix in (*FULL, ".mf4", ".trc"):
        data = np.flatnonzero((frames.flags & (Flag.REMOTE | Flag.ERROR)) == 0)
        frames.flags[data[::4]] |= np.uint8(Flag.SENT)
    if suffix in (".csv", ".db"):
        frames.channel[:] = 0
    return frames


def messages(frames: Frames) -> list[can.Message]:
    rows = zip(
        frames.t_ns,
        frames.channel,
        frames.id,
        frames.flags,
        frames.length,
        frames.data,
        strict=True,
    )
    return [
        can.Message(
            timestamp=int(t) / 1e9,
            channel=int(channel),
            arbitration_id=int(can_id),
            is_extended_id=bool(flags & Flag.EXTENDED),
            is_remote_frame=bool(flags & Flag.REMOTE),
            is_error_frame=bool(flags & Flag.ERROR),
            is_fd=bool(flags & Flag.FD),
            bitrate_switch=bool(flags & Flag.BITRATE_SWITCH),
            is_rx=not flags & Flag.SENT,
            error_state_indicator=bool(flags & Flag.ERROR_STATE),
            dlc=int(length),
            data=None if flags & Flag.REMOTE else data[:length].tobytes(),
        )
        for t, channel, can_id, flags, length, data in rows
    ]


def assert_same(
    frames: Frames, theirs: list[can.Message], first_channel: int = 0, fd_told: bool = True
) -> None:
    assert len(frames) == len(theirs)
    assert not any(m.is_error_frame and m.arbitration_id for m in theirs)  # their class is lost
    np.testing.assert_allclose(
        [m.timestamp for m in theirs], frames.t_ns / 1e9, atol=1.01e-6, rtol=0
    )
    for ours, message in zip(messages(frames), theirs, strict=True):
        flags = [
            (
                not m.is_error_frame and m.arbitration_id,
                m.is_remote_frame,
                m.is_error_frame,
                m.is_rx,
                m.bitrate_switch,
                m.error_state_indicator,
                m.dlc,
                bytes(m.data),
                m.is_extended_id or m.is_error_frame,
                m.is_fd or not fd_told,
            )
            for m in (ours, message)
        ]
        assert flags[0] == flags[1]
        if isinstance(message.channel, int) and not message.is_error_frame:
            assert ours.channel == message.channel - first_channel


def named(m: can.Message) -> can.Message:
    """candump's channels have names in python-can."""
    if isinstance(m.channel, str):
        m.channel = int(m.channel.removeprefix("can"))
    return m


def theirs(path: Path) -> list[can.Message]:
    with READERS[path.suffix](path) as reader:
        return [named(m) for m in reader]


@pytest.mark.parametrize("suffix", READERS)
def test_what_python_can_writes_is_read_as_python_can_reads_it(suffix, tmp_path):
    frames = mixture(suffix, 1000, seed=21)
    path = tmp_path / f"a{suffix}"
    with can.Logger(path) as writer:
        for message in messages(frames):
            writer.on_message_received(message)
    given = read_frames(path)
    assert given.rejected == ()
    first = 1 if suffix in (".trc",) else 0
    assert_same(given, theirs(path), first, fd_told=suffix != ".csv")


@pytest.mark.parametrize("suffix", [".log", ".asc", ".blf", ".trc", ".csv", ".mf4", ".db"])
def test_python_can_reads_what_is_written(suffix, tmp_path):
    frames = mixture(suffix, 1000, seed=22)
    if suffix == ".db":
        frames.t_ns[:] = frames.t_ns // 1000 * 1000
    path = tmp_path / f"a{suffix}"
    assert write_frames(frames, path) == ()
    assert_same(frames, theirs(path), 1 if suffix == ".trc" else 0, fd_told=suffix != ".csv")


def test_python_can_reads_our_fd_in_trc(tmp_path):
    frames = random_frames(500, seed=23, fd=True)
    classic = np.flatnonzero((frames.flags & Flag.FD) == 0)
    frames.flags[classic[::3]] |= np.uint8(Flag.REMOTE)
    frames.data[classic[::3]] = 0
    write_frames(frames, tmp_path / "a.trc")
    for ours, message in zip(messages(frames), theirs(tmp_path / "a.trc"), strict=True):
        message.dlc = ours.dlc  # python-can takes the code for the length
        message.channel -= 1
        assert ours.equals(message, timestamp_delta=1e-6, check_channel=True)


@pytest.mark.parametrize("version", [can.TRCFileVersion.V1_0, can.TRCFileVersion.V2_1])
def test_versions_of_trc(version, tmp_path):
    frames = random_frames(300, seed=24)
    path = tmp_path / "a.trc"
    with can.TRCWriter(path) as writer:
        writer.file_version = version
        for message in messages(frames):
            writer.on_message_received(message)
    assert_same(read_frames(path), theirs(path), first_channel=1)


BODY = {  # the same two frames, told by each version
    "1.1": "  1)  1.9  Rx  0076  2  3E 80\n  2)  2.125  Tx  18FEF100  1  07\n",
    "1.2": "  1)  1.9  1  Rx  0076  2  3E 80\n  2)  2.125  2  Tx  18FEF100  1  07\n",
    "1.3": "  1)  1.9  1  Rx  0076  -  2  3E 80\n  2)  2.125  2  Tx  18FEF100  -  1  07\n",
    "2.0": "  1  1.9  DT  0076  Rx  2  3E 80\n  2  2.125  DT  18FEF100  Tx  1  07\n",
    "2.1": "  1  1.9  DT  1  0076  Rx  -  2  3E 80\n  2  2.125  DT  2  18FEF100  Tx  -  1  07\n",
}
COLUMNS = {"2.0": ";$COLUMNS=N,O,T,I,d,l,D\n", "2.1": ";$COLUMNS=N,O,T,B,I,d,R,L,D\n"}


@pytest.mark.parametrize("version", BODY)
def test_columns_of_trc_by_hand(version, tmp_path):
    path = tmp_path / "a.trc"
    path.write_text(
        f";$FILEVERSION={version}\n;$STARTTIME=45860.5\n{COLUMNS.get(version, '')}{BODY[version]}"
    )
    frames = read_frames(path)
    start = 1_753_185_600 * 10**9
    assert (frames.t_ns - start).tolist() == [1_900_000, 2_125_000]
    assert frames.id.tolist() == [0x76, 0x18FEF100]
    assert frames.flags.tolist() == [0, Flag.EXTENDED | Flag.SENT]
    assert frames.channel.tolist() == [0, 0 if version in ("1.1", "2.0") else 1]
    assert [d[:n].tobytes() for d, n in zip(frames.data, frames.length, strict=True)] == [
        b"\x3e\x80",
        b"\x07",
    ]


ASC_BODY = """{t[0]} 1  {id[0]}             Rx   d 8 {data}  Length = 0 BitCount = 64 ID = 100x
{t[1]} CAN 1 Status:chip status error passive - TxErr: 132 RxErr: 0
{t[2]} CANFD   2 Tx        {id[1]}  A_Name  1 0 9 12 {data} {more}   102203  133  303000 e0006659
{t[3]} CANFD   2 Rx        {id[1]}  0 1 2 2 {two}   102203  133
{t[4]} 1  {id[0]}             Rx   r
{t[5]} 2  ErrorFrame
"""


@pytest.mark.parametrize("base", ["hex", "dec"])
@pytest.mark.parametrize("stamps", ["absolute", "relative"])
@pytest.mark.parametrize("encoding", ["utf-8", "latin-1"])
def test_bases_of_asc_by_hand(base, stamps, encoding, tmp_path):
    times = [0.5, 1.0, 1.25, 1.5, 2.0, 2.000001]
    told = np.diff(times, prepend=0) if stamps == "relative" else times
    number = "{:02X}" if base == "hex" else "{}"
    payload = [0, 1, 2, 10, 100, 200, 254, 255]
    body = ASC_BODY.format(
        t=[f"{t:.6f}" for t in told],
        id=["64", "12D687x"] if base == "hex" else ["100", "1234567x"],
        data=" ".join(number.format(b) for b in payload),
        more=" ".join(number.format(b) for b in (9, 8, 7, 99)),
        two=" ".join(number.format(b) for b in (16, 17)),
    )
    header = f"date Mon Mär 4 10:13:20.250 pm 2024\nbase {base}  timestamps {stamps}\n"
    (tmp_path / "a.asc").write_text(header + "internal events logged\n" + body, encoding)
    frames = read_frames(tmp_path / "a.asc")
    start = round(datetime(2024, 3, 4, 22, 13, 20, 250000).timestamp() * 1e3) * 10**6
    kept = [times[i] for i in (0, 2, 3, 4, 5)]
    assert (frames.t_ns - start).tolist() == [round(t * 1e9) for t in kept]
    assert frames.id.tolist() == [100, 1234567, 1234567, 100, 0]
    assert frames.channel.tolist() == [0, 1, 1, 0, 1]
    assert frames.length.tolist() == [8, 12, 2, 0, 0]
    fd = Flag.EXTENDED | Flag.FD
    assert frames.flags.tolist() == [
        0,
        fd | Flag.SENT | Flag.BITRATE_SWITCH,
        fd | Flag.ERROR_STATE,
        Flag.REMOTE,
        Flag.ERROR,
    ]
    assert frames.data[1, :12].tolist() == [*payload, 9, 8, 7, 99]
    assert frames.data[2, :2].tolist() == [16, 17]
    assert frames.rejected == (("no CAN frame in this line", 1),)


def test_a_real_trc_is_like_python_can(real):
    path = real("gt350_launch.trc")
    frames = read_frames(path)
    expected = theirs(path)
    assert len(expected) == len(frames)
    assert [m.arbitration_id for m in expected] == frames.id.tolist()
    width = frames.data.shape[1]
    data = b"".join(bytes(m.data).ljust(width, b"\0") for m in expected)
    assert data == frames.data.tobytes()
    np.testing.assert_allclose(
        [m.timestamp for m in expected], frames.t_ns / 1e9, atol=1e-6, rtol=0
    )
