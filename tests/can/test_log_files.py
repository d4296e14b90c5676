from __future__ import annotations

import gc
import gzip
import re
import sqlite3
from contextlib import closing
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest
from asammdf import MDF

import can
from clutchest.can import log_source
from clutchest.can.files import read_blocks, read_frames, write_frames
from clutchest.can.formats import log_formats
from clutchest.can.frames import Flag, Frames
from clutchest.can.log_format import NO_CHANNELS
from clutchest.errors import ClutchestError
from samples import random_frames

FORMATS = {entry.suffix: entry for entry in log_formats() if entry.writable}
SUFFIXES = [suffix + zipped for zipped in ("", ".gz") for suffix in FORMATS]


def assert_equal(given: Frames, expected: Frames) -> None:
    for column in ("t_ns", "channel", "id", "flags", "length", "data"):
        a, b = getattr(given, column), getattr(expected, column)
        assert a.dtype == b.dtype, column
        np.testing.assert_array_equal(a, b, err_msg=column)
    assert given.absolute == expected.absolute
    assert given.rejected == ()


def without_channels(frames: Frames) -> Frames:
    return replace(frames, channel=np.zeros_like(frames.channel))


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("absolute", [True, False])
def test_what_is_written_is_read_back(suffix, absolute, tmp_path):
    frames = random_frames(300, seed=3)
    if not absolute:
        frames = replace(frames, t_ns=frames.t_ns - frames.t_ns[0] + 2_500_000_000, absolute=False)
    if NO_CHANNELS in FORMATS[suffix.removesuffix(".gz")].losses:
        frames = without_channels(frames)
    if suffix.startswith(".db"):
        frames = replace(frames, t_ns=frames.t_ns // 1000 * 1000)
    path = tmp_path / f"drive{suffix}"
    assert write_frames(frames, path) == ()
    assert_equal(read_frames(path), frames)
    assert sorted(p.name for p in tmp_path.iterdir()) == [path.name]


def of_all_kinds(n: int) -> Frames:
    """FD, remote, error and sent frames among others."""
    frames = random_frames(n, seed=4, fd=True)
    classic = np.flatnonzero((frames.flags & Flag.FD) == 0)
    frames.flags[classic[::3]] |= np.uint8(Flag.REMOTE)
    frames.data[classic[::3]] = 0
    errors = classic[1::3]
    frames.flags[errors], frames.id[errors], frames.length[errors] = Flag.ERROR, 0, 0
    frames.data[errors] = 0
    frames.flags[classic[2::6]] |= np.uint8(Flag.SENT)
    return frames


@pytest.mark.parametrize("suffix", [".log", ".asc", ".blf", ".mf4", ".trc"])
def test_fd_remote_and_error_frames_are_read_back(suffix, tmp_path):
    frames = of_all_kinds(200)
    path = tmp_path / f"drive{suffix}"
    assert write_frames(frames, path) == ()
    assert_equal(read_frames(path), frames)


def test_what_a_format_cannot_keep_is_said(tmp_path):
    frames = random_frames(50, seed=5)
    frames.flags[::5] |= np.uint8(Flag.REMOTE)
    frames.flags[1::5] = np.uint8(Flag.ERROR)
    (loss,) = write_frames(frames, tmp_path / "a.csv")
    assert loss == ".csv cannot tell the channels apart"
    frames.t_ns[7] += 1
    frames.flags[7] |= np.uint8(Flag.SENT)
    losses = write_frames(frames, tmp_path / "a.db")
    assert losses == (
        ".db cannot tell the channels apart",
        ".db cannot hold direction, bit rate switch and error state",
        ".db holds times to 1 µs",
    )


def test_mf4_is_what_asammdf_takes_for_bus_logging(tmp_path, truck):
    from clutchest.can.decode import decode, rows_of
    from clutchest.can.encode import encode
    from clutchest.shipped import locate

    message = truck.message("EEC1")
    t_ns = 1_700_000_000 * 10**9 + np.arange(200) * 10**7
    speed = np.linspace(600, 2000, 200)
    frames = encode(message, {"EngineSpeed": speed}, t_ns)
    write_frames(frames, tmp_path / "a.mf4")
    with MDF(tmp_path / "a.mf4") as mdf:
        extracted = mdf.extract_bus_logging({"CAN": [(str(locate("hdt_clutch", "dbc")), 0)]})
        signal = extracted.get("EngineSpeed")
    rows = rows_of(frames, message)
    np.testing.assert_array_equal(
        signal.samples, decode(frames, rows, message, ["EngineSpeed"])["EngineSpeed"].value
    )
    np.testing.assert_allclose(signal.timestamps, np.arange(200) * 0.01, atol=1e-9)


@pytest.mark.parametrize("bytes_together", [1, 700, 10_000, 1 << 20])
def test_mf4_is_read_in_blocks(bytes_together, tmp_path, monkeypatch):
    """Groups of data, remote and error frames, however many at a time, come by time and whole."""
    whole = of_all_kinds(300)
    write_frames(whole, tmp_path / "a.mf4")
    monkeypatch.setattr("clutchest.can.recovery.mf4_channels.TOGETHER", bytes_together)
    blocks = list(read_blocks(tmp_path / "a.mf4"))
    assert_equal(Frames.concatenate(blocks), whole)
    assert max(map(len, blocks)) <= 3 * max(bytes_together // 70, 1)
    edges = [t for block in blocks if len(block) for t in (block.t_ns[0], block.t_ns[-1])]
    assert np.all(np.diff(edges) >= 0)


def test_what_a_damaged_mf4_holds_before_the_damage_is_kept(tmp_path):
    frames = random_frames(300_000, seed=5)
    path = tmp_path / "a.mf4"
    write_frames(frames, path)
    content = bytearray(path.read_bytes())
    place = len(content) * 3 // 4
    content[place : place + 200] = b"\xff" * 200
    path.write_bytes(content)
    given = read_frames(path)
    assert 0.2 * len(frames) < len(given) < 0.75 * len(frames)
    assert_equal(replace(given, rejected=()), frames.take(slice(len(given))))
    ((why, lost),) = given.rejected
    assert "damaged" in why and lost == len(frames) - len(given)


def test_python_can_reads_our_mf4(tmp_path):
    frames = random_frames(30, seed=6, fd=True)
    write_frames(frames, tmp_path / "a.mf4")
    with can.MF4Reader(tmp_path / "a.mf4") as reader:
        messages = list(reader)
    assert [m.arbitration_id for m in messages] == frames.id.tolist()
    assert [bytes(m.data) for m in messages] == [
        d[:n].tobytes() for d, n in zip(frames.data, frames.length, strict=True)
    ]


def test_mf4_of_python_can(tmp_path):
    with can.MF4Writer(tmp_path / "a.mf4") as writer:
        for i in range(20):
            writer.on_message_received(
                can.Message(
                    timestamp=1_900_000_000 + 0.001 * i,
                    arbitration_id=0x18FEF100 + i,
                    channel=1,
                    data=bytes(range(i % 9)),
                    is_remote_frame=False,
                )
            )
    frames = read_frames(tmp_path / "a.mf4")
    assert frames.id.tolist() == [0x18FEF100 + i for i in range(20)]
    assert frames.length.tolist() == [i % 9 for i in range(20)]
    assert set(frames.channel) == {1} and set(frames.flags) == {Flag.EXTENDED}
    np.testing.assert_allclose(frames.t_ns * 1e-9, 1_900_000_000 + 0.001 * np.arange(20), atol=2e-6)


def test_the_suffix_may_be_wrong(tmp_path):
    frames = without_channels(random_frames(20, seed=7))
    for suffix in (".log", ".asc", ".blf", ".trc", ".csv", ".mf4"):
        write_frames(frames, tmp_path / f"a{suffix}")
        (tmp_path / f"a{suffix}").rename(tmp_path / "a.txt")
        assert_equal(read_frames(tmp_path / "a.txt"), frames)


def test_sqlite_of_python_can(tmp_path):
    with can.SqliteWriter(tmp_path / "a.db") as writer:
        writer.on_message_received(
            can.Message(timestamp=1.5, arbitration_id=0x123, data=[1, 2], is_extended_id=False)
        )
    frames = read_frames(tmp_path / "a.db")
    assert (frames.t_ns.tolist(), frames.id.tolist()) == ([1_500_000_000], [0x123])


ASC = """date Mon Nov 20 10:13:20.250 am 2023
base hex  timestamps absolute
internal events logged
Begin Triggerblock Mon Nov 20 10:13:20.250 am 2023
   0.000000 Start of measurement
   0.100000 1  18FEF100x       Rx   d 2 FF 01
   0.200000 2  123             Tx   d 1 07
   0.300000 1  123             Rx   r
   0.400000 1  ErrorFrame
End TriggerBlock
"""


def test_asc_date_makes_time_absolute(tmp_path):
    path = tmp_path / "a.asc"
    path.write_text(ASC)
    frames = read_frames(path)
    start = round(datetime(2023, 11, 20, 10, 13, 20, 250000).timestamp() * 1000) * 10**6
    assert ((frames.t_ns - start) / 1e6).tolist() == [100, 200, 300, 400]
    assert frames.flags.tolist() == [Flag.EXTENDED, Flag.SENT, Flag.REMOTE, Flag.ERROR]
    assert frames.channel.tolist() == [0, 1, 0, 0]
    assert frames.absolute and frames.rejected == ()


@pytest.mark.parametrize(
    "date",
    [
        "2023-11-20 10:13:20.250",
        "2023-11-20T10:13:20.25",
        "2023/11/20 10:13:20,250",
        "Mon 2023-11-20 10:13:20.250",
        "20.11.2023 10:13:20.250",
        "11/20/2023 10:13:20.250 am",
        "20/11/2023 10:13:20.250",
        "Mo Nov 20 10:13:20.250 2023",
        "2023-11-20T10:13:20.250Z",
        "2023-11-20 11:13:20.250 +01:00",
        "2023-11-20T04:43:20.250-0530",
    ],
)
def test_asc_dates_in_numbers(date, tmp_path):
    path = tmp_path / "a.asc"
    path.write_text(ASC.replace("Mon Nov 20 10:13:20.250 am 2023", date))
    zone = UTC if re.search(r"(Z|[+-]\d\d:?\d\d)$", date) else None
    frames = read_frames(path)
    start = round(datetime(2023, 11, 20, 10, 13, 20, 250000, zone).timestamp() * 1000) * 10**6
    assert frames.absolute and not frames.notes
    assert ((frames.t_ns - start) / 1e6).tolist() == [100, 200, 300, 400]


@pytest.mark.parametrize(
    "date", ["05/04/2023 10:13:20", "sometime in May", "2023-13-20 10:13:20", "20.11.23 10:13:20"]
)
def test_an_asc_date_that_cannot_be_read_is_said(date, tmp_path):
    path = tmp_path / "a.asc"
    path.write_text(ASC.replace("Mon Nov 20 10:13:20.250 am 2023", date))
    frames = read_frames(path)
    assert not frames.absolute and len(frames) == 4
    assert len(frames.notes) == 1 and date in frames.notes[0]


def test_asc_stamps_from_line_to_line_are_added_up(tmp_path):
    path = tmp_path / "a.asc"
    body = ASC.replace("absolute", "relative").split("\n", 1)[1]
    body = "\n".join(line for line in body.splitlines() if "Triggerblock" not in line)
    path.write_text(body)
    frames = read_frames(path)
    assert (frames.t_ns / 1e6).tolist() == [100, 300, 600, 1000]
    assert not frames.absolute


@pytest.mark.parametrize("count", [20, 60])
@pytest.mark.parametrize("suffix", FORMATS)
def test_stamps_before_zero_are_read_back(suffix, count, tmp_path):
    """Those of frames before a trigger."""
    frames = random_frames(count, seed=9)
    t_ns = (np.arange(count) - 10) * 250_000_000 - 123_000
    frames = replace(frames, t_ns=t_ns, absolute=False)
    if NO_CHANNELS in FORMATS[suffix].losses:
        frames = without_channels(frames)
    write_frames(frames, tmp_path / f"a{suffix}")
    assert_equal(read_frames(tmp_path / f"a{suffix}"), frames)


def test_asc_stamps_before_the_trigger(tmp_path):
    (tmp_path / "a.asc").write_text(
        "date Wed Mar 8 02:03:04.500 pm 2023\nbase hex  timestamps absolute\n"
        "Begin Triggerblock Wed Mar 8 02:03:04.500 pm 2023\n"
        " -1.250000 1  1A0  Rx  d 1 01\n  -0.000001 1  1A0  Rx  d 1 02\n"
        "  0.000000 1  1A0  Rx  d 1 03\n -x 1  1A0  Rx  d 1 04\n"
    )
    frames = read_frames(tmp_path / "a.asc")
    start = round(datetime(2023, 3, 8, 14, 3, 4, 500000).timestamp() * 1e6) * 1000
    assert (frames.t_ns - start).tolist() == [-1_250_000_000, -1000, 0]
    assert frames.rejected == (("time stamp cannot be read", 1),)


OLD_FD = """date Thu May 4 09:10:11 am 2006
base hex  timestamps absolute
internal events logged
// version 7.2.0
   1.500000 CANFD 2  2A1             Rx   0 1 d a 16 00 01 02 03 04 05 06 07 08 09 0A 0B 0C 0D 0E 0F
   1.600000 CANFD 1  18FEF100x       Tx   1 0 d 2 2 AA BB  Length = 209000 BitCount = 128 ID = 1
   1.700000 CANFD 1  7FF             Rx   0 0 r 3  Length = 138000 BitCount = 57 ID = 2047
   1.800000 CANFD 1  123             Xx   0 0 d 1 1 07
   1.900000 CANFD 1  123             Rx   0 0 x 1 1 07
   2.000000 CANFD 1 Rx  123  Name    0 0 1 1 07
"""


def test_asc_fd_lines_of_older_versions(tmp_path):
    (tmp_path / "a.asc").write_text(OLD_FD)
    frames = read_frames(tmp_path / "a.asc")
    fd = Flag.FD
    assert frames.id.tolist() == [0x2A1, 0x18FEF100, 0x7FF, 0x123]
    assert frames.flags.tolist() == [
        fd | Flag.ERROR_STATE,
        fd | Flag.EXTENDED | Flag.SENT | Flag.BITRATE_SWITCH,
        Flag.REMOTE,
        fd,
    ]
    assert frames.length.tolist() == [16, 2, 3, 1] and frames.channel.tolist() == [1, 0, 0, 0]
    assert frames.data[0, :16].tolist() == list(range(16))
    assert frames.data[1, :3].tolist() == [0xAA, 0xBB, 0]
    assert dict(frames.rejected) == {
        "no CAN frame in this line": 1,
        "payload cannot be read or is too long": 1,
    }


@pytest.mark.parametrize(
    ("first", "daytime"),
    [(47_105.5, True), (47_104.2, True), (47_300.0, False), (0.5, False)],
)
def test_asc_stamps_that_are_the_time_of_day(first, daytime, tmp_path):
    """As BusMaster has it."""
    (tmp_path / "a.asc").write_text(
        "date Tue Sep 6 01:05:05 pm 2022\nbase hex  no internal events logged\n// version 7.1.0\n"
        f"{first:.6f} 1 122 Rx d 1 01\n{first + 0.25:.6f} 1 122 Rx d 1 02\n"
    )
    frames = read_frames(tmp_path / "a.asc")
    zero = datetime(2022, 9, 6) if daytime else datetime(2022, 9, 6, 13, 5, 5)
    stamps = [round((zero.timestamp() + first + dt) * 1e6) * 1000 for dt in (0, 0.25)]
    assert frames.absolute and frames.t_ns.tolist() == stamps


@pytest.mark.parametrize("header", ["", "base hex  timestamps absolute\n"])
def test_asc_with_a_short_header_loses_no_frame(header, tmp_path):
    path = tmp_path / "a.asc"
    path.write_text(
        header + "Begin Triggerblock Mon Nov 20 10:13:20 2023\n"
        " 0.1 1  123  Rx  d 1 01\n 0.2 1  123  Rx  d 1 02\n"
    )
    assert read_frames(path).data[:, 0].tolist() == [1, 2]


TRC_11 = """;$FILEVERSION=1.1
;$STARTTIME=45860.5
;
     1)         1.9  Rx         0076  8  3E 80 40 00 00 00 00 00
     2)         2.1  Rx     18FEF100  2  00 01
"""


def test_trc_start_time_makes_time_absolute(tmp_path):
    path = tmp_path / "a.trc"
    path.write_text(TRC_11)
    frames = read_frames(path)
    start = 1753185600 * 10**9  # 22 July 2025, 12:00 UTC
    assert (frames.t_ns - start).tolist() == [1_900_000, 2_100_000]
    assert frames.flags.tolist() == [0, Flag.EXTENDED]
    assert frames.absolute and set(frames.channel) == {0}


TRC_ERRORS = {
    "1.1": """;$FILEVERSION=1.1
      1)      10.5  Rx        0300  2  01 02
      2)      11.5  Error     0008  4  00 19 08 08
      3)      12.5  Warng     FFFFFFFF  4  00 00 00 08  BUSHEAVY
""",
    "1.3": """;$FILEVERSION=1.3
      1)      10.5 2  Rx        0300 -  2    01 02
      2)      11.5 2  Error     0004 -  5    04 00 02 00 00
      3)      12.5 1  Warng     FFFFFFFF -  4    00 00 00 08  BUSHEAVY
""",
    "2.0": """;$FILEVERSION=2.0
;$COLUMNS=N,O,T,B,I,d,l,D
      1      10.5 DT 2     0300 Rx 2  01 02
      2      11.5 ER 2          Rx    04 00 02 00 00
      3      12.5 ST 2          Rx    00 00 00 08
""",
    "2.1": """;$FILEVERSION=2.1
;$COLUMNS=N,O,T,B,I,d,R,L,D
      1      10.5 DT 2     0300 Rx -  2    01 02
      2      11.5 ER 2        - Rx -  5    04 00 02 00 00
      3      12.5 EC 2        - Rx -  2    02 02
""",
}


@pytest.mark.parametrize("version", TRC_ERRORS)
def test_trc_error_frames(version, tmp_path):
    (tmp_path / "a.trc").write_text(TRC_ERRORS[version])
    frames = read_frames(tmp_path / "a.trc")
    assert frames.t_ns.tolist() == [10_500_000, 11_500_000]
    assert frames.flags.tolist() == [0, Flag.ERROR] and frames.id.tolist() == [0x300, 0]
    assert frames.length.tolist() == [2, 0] and not frames.data[1].any()
    assert set(frames.channel) == {0 if version == "1.1" else 1}
    assert frames.rejected == (("status of the bus, no frame", 1),)


def test_trc_without_a_start_is_relative(tmp_path):
    path = tmp_path / "a.trc"
    path.write_text(";##########\n;   PCAN\n 1)  1 0076 2 3E 80\n 2)  3 00000077 1 01\n")
    frames = read_frames(path)
    assert frames.t_ns.tolist() == [1_000_000, 3_000_000] and not frames.absolute


@pytest.mark.parametrize("marked", [True, False])
@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16-le", "utf-16-be"])
@pytest.mark.parametrize("suffix", [".log", ".asc.gz", ".trc", ".csv"])
def test_byte_order_marks(suffix, encoding, marked, tmp_path, monkeypatch):
    """Of text that went through an editor or a shell of Windows."""
    monkeypatch.setattr(log_source, "_PIECE", 1001)
    frames = without_channels(random_frames(3000, seed=12))
    write_frames(frames, tmp_path / f"a{suffix}")
    opener = gzip.open if suffix.endswith(".gz") else open
    with opener(tmp_path / f"a{suffix}", "rb") as file:
        text = file.read().decode()
    mark = "" if encoding == "utf-8-sig" or not marked else "\ufeff"
    with opener(tmp_path / f"b{suffix}", "wb") as file:
        file.write((mark + text.replace("\n", "\r\n")).encode(encoding))
    assert_equal(read_frames(tmp_path / f"b{suffix}"), frames)


def test_csv_stamps_as_python_writes_small_numbers(tmp_path):
    stamps = ["0.0", "1.5e-07", "1e-06", "5.25e-05", "9.9E-05", "0.0001", "0.25"]
    header = "timestamp,arbitration_id,extended,remote,error,dlc,data\n"
    rows = [f"{stamp},0x123,0,0,0,1,Bw==\n" for stamp in stamps]
    (tmp_path / "a.csv").write_text(header + "".join(rows))
    frames = read_frames(tmp_path / "a.csv")
    assert frames.t_ns.tolist() == [0, 150, 1000, 52_500, 99_000, 100_000, 250_000_000]
    assert not frames.absolute and set(frames.data[:, 0]) == {7}


@pytest.mark.parametrize("suffix", [".log", ".asc", ".trc", ".csv"])
@pytest.mark.parametrize("breakage", ["garbage", "hex", "cut"])
def test_broken_lines_are_counted_and_the_rest_kept(suffix, breakage, tmp_path):
    frames = without_channels(random_frames(60, seed=8))
    frames.length[:] = 8
    path = tmp_path / f"a{suffix}"
    write_frames(frames, path)
    lines = path.read_text().splitlines(keepends=True)
    first = len(lines) - 60 - suffix.count("asc")  # asc ends with a line of its own
    broken = [5, 6, 30]
    for i in broken:
        line = lines[first + i]
        lines[first + i] = {
            "garbage": "§$%&/() no frame\n",
            "hex": line.rstrip()[:-2].rstrip() + ("§!\n" if suffix != ".csv" else "%%%==,\n"),
            "cut": line[: len(line) // 3] + "\n",
        }[breakage]
    path.write_text("".join(lines))
    given = read_frames(path)
    assert sum(count for _, count in given.rejected) == len(broken)
    assert_equal(replace(given, rejected=()), frames.take(~np.isin(np.arange(60), broken)))


@pytest.mark.parametrize("zipped", [False, True], ids=["", "gz"])
@pytest.mark.parametrize("suffix", [".log", ".asc", ".trc", ".csv", ".blf"])
def test_a_file_that_ends_early_keeps_what_it_has(suffix, zipped, tmp_path):
    frames = random_frames(20_000, seed=9)
    if suffix == ".csv":
        frames = without_channels(frames)
    path = tmp_path / f"a{suffix}"
    write_frames(frames, path)
    content = gzip.compress(path.read_bytes()) if zipped else path.read_bytes()
    for share in (0.1, 2 / 3, 0.99):
        path.write_bytes(content[: int(share * len(content))])
        given = read_frames(path)
        n = len(given)
        assert abs(n - share * len(frames)) < 0.01 * len(frames)
        assert sum(count for _, count in given.rejected) >= 1
        assert_equal(replace(given, rejected=()), frames.take(np.arange(n)))


@pytest.mark.parametrize("damage", ["cut", "overwritten"])
@pytest.mark.parametrize("share", [0.1, 2 / 3, 0.99])
def test_a_damaged_sqlite_log_keeps_what_it_has(share, damage, tmp_path):
    frames = without_channels(random_frames(20_000, seed=9))
    rows = zip(
        (frames.t_ns / 1e9).tolist(),
        frames.id.tolist(),
        (frames.flags & 1).tolist(),
        frames.length.tolist(),
        (bytes(data[:n]) for data, n in zip(frames.data, frames.length, strict=True)),
        strict=True,
    )
    path = tmp_path / "a.db"
    with closing(sqlite3.connect(path)) as database, database:
        database.execute(
            "CREATE TABLE messages (ts REAL, arbitration_id INTEGER, extended INTEGER,"
            " remote INTEGER, error INTEGER, dlc INTEGER, data BLOB)"
        )
        database.executemany("INSERT INTO messages VALUES (?, ?, ?, 0, 0, ?, ?)", rows)
    content = path.read_bytes()
    at = int(share * len(content))
    path.write_bytes(
        content[:at] + (b"" if damage == "cut" else b"\xff" * 5000 + content[at + 5000 :])
    )
    given = read_frames(path)
    assert given.rejected == (("file is damaged or ends early", 1),)
    assert len(given) > (share if damage == "cut" else 1.0) * len(frames) - 400
    assert_equal(replace(given, rejected=()), frames.take(np.searchsorted(frames.t_ns, given.t_ns)))


@pytest.mark.filterwarnings("error")  # nor may asammdf leave a traceback behind
@pytest.mark.parametrize("kept", [0.01, 0.02, 0.1, 0.3, 0.5, 0.7, 0.9, 0.99])
def test_a_truncated_mf4_is_told_in_one_line(kept, tmp_path):
    write_frames(random_frames(20_000, seed=10), tmp_path / "a.mf4")
    content = (tmp_path / "a.mf4").read_bytes()
    (tmp_path / "a.mf4").write_bytes(content[: int(kept * len(content))])
    with pytest.raises(ClutchestError, match=r"a\.mf4: ") as caught:
        read_frames(tmp_path / "a.mf4")
    gc.collect()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.log", b"", "the file is empty"),
        ("a.log", b"\n \n", "the file is empty"),
        ("a.log.gz", gzip.compress(b"", mtime=0), "the file is empty"),
        ("a.log", b"hello world\nthis is no log\n", "not a CAN log.*'hello world'.*candump"),
        ("a.csv", b"time,engine_speed\n0,1\n", "not a CAN log"),
        ("a.log", b"RRF2\0)\0\0 and more", "not a CAN log.*begins with binary data; expected"),
        ("a.log", b"\xb5l!4]\x0b\xca>\n", "not a CAN log.*begins with binary data; expected"),
        ("a.log", b"(1.0) can0 zzz\n", "no CAN frame could be read: 1 × id is not"),
        ("a.trc", b";$FILEVERSION=1.1\n 1) 1.9 Rx\n", "no CAN frame could be read: 1 × no"),
        ("a.trc", b";$FILEVERSION=2.1\n 1) 1.9 DT 1 0076 Rx - 1 00\n", "no CAN frame"),
        ("a.blf", b"LOGG" + bytes(200), "no CAN frame could be read"),
        ("a.blf", b"LOGG", "no CAN frame could be read"),
        ("a.mf4", b"MDF     4.10", "damaged"),
        ("a.log.gz", b"\x1f\x8b\x08garbage", "gzip"),
        ("a.db", b"SQLite format 3\0" + bytes(100), "damaged"),
    ],
)
def test_a_file_without_frames_is_an_error(name, content, message, tmp_path):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ClutchestError, match=message) as caught:
        read_frames(tmp_path / name)
    assert name in str(caught.value) and "\n" not in str(caught.value)


def test_what_sqlite_cannot_hold_is_said(tmp_path):
    frames = random_frames(40, seed=12, fd=True)
    frames.flags[frames.length <= 8] |= np.uint8(Flag.FD)
    frames.t_ns[:] += 1
    said = write_frames(frames, tmp_path / "a.db")
    assert [
        word
        for word in ("channels", "bit rate", "1 µs", "FD frames")
        if not any(word in what for what in said)
    ] == []
    given = read_frames(tmp_path / "a.db")
    assert np.abs(given.t_ns - frames.t_ns).max() <= 1000
    for column in ("id", "length", "data"):
        np.testing.assert_array_equal(getattr(given, column), getattr(frames, column))


def test_missing_file_and_unknown_suffix(tmp_path):
    with pytest.raises(ClutchestError, match=r"nowhere\.log: cannot be read"):
        read_frames(tmp_path / "nowhere.log")
    with pytest.raises(ClutchestError, match=r"suffix '\.acs'; did you mean .*'\.asc'"):
        write_frames(random_frames(2, seed=11), tmp_path / "a.acs")
    with pytest.raises(ClutchestError, match=r"suffix '\.mf\.gz'; did you mean '\.mf4\.gz'"):
        write_frames(random_frames(2, seed=11), tmp_path / "a.mf.gz")
    with pytest.raises(ClutchestError, match="cannot be written"):
        write_frames(random_frames(2, seed=11), tmp_path / "no" / "folder.log")
