"""Logs of other tools: the layouts that they write, by hand, and the values that stand in them."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from clutchest.can import log_source
from clutchest.can.files import read_frames, write_frames
from clutchest.can.frames import LENGTH_CODE, Flag, Frames
from clutchest.errors import ClutchestError
from clutchest.reading.table_formats import is_table
from samples import random_frames

US = 1000


def written(path: Path, text: str | bytes) -> Path:
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def sample(fd: bool = False) -> Frames:
    """Data frames on two channels, times in whole 100 µs."""
    frames = random_frames(200, seed=5, fd=fd)
    keep = (Flag.EXTENDED | Flag.SENT | Flag.FD) if fd else (Flag.EXTENDED | Flag.SENT)
    wide = (frames.length > 8) & ~np.bool_(not fd)
    flags = frames.flags & np.uint8(keep)
    flags = np.where(wide, flags | np.uint8(Flag.FD), flags & ~np.uint8(Flag.FD)).astype(np.uint8)
    t_ns = np.sort(frames.t_ns) // 100_000 * 100_000
    return replace(frames, t_ns=t_ns, flags=flags, channel=frames.channel % 2)


def rows(frames: Frames):
    for k in range(len(frames)):
        flags = Flag(int(frames.flags[k]))
        data = bytes(frames.data[k, : frames.length[k]])
        yield int(frames.t_ns[k]), int(frames.channel[k]), int(frames.id[k]), flags, data


def gvret(frames: Frames) -> str:
    lines = ["Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8"]
    for t, channel, can_id, flags, data in rows(frames):
        ext = "true" if flags & Flag.EXTENDED else "false"
        way = "Tx" if flags & Flag.SENT else "Rx"
        cells = "".join(f"{b:02X}," for b in data)
        lines.append(f"{t // US},{can_id:08X},{ext},{way},{channel},{len(data)},{cells}")
    return "\n".join(lines) + "\n"


def native(frames: Frames) -> str:
    """Of versions without a direction."""
    lines = ["Time Stamp,ID,Extended,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8"]
    for t, channel, can_id, flags, data in rows(frames):
        ext = "true" if flags & Flag.EXTENDED else "false"
        cells = ",".join(f"{b:02X}" for b in data)
        lines.append(f"{t // US},{can_id:08X},{ext},{channel},{len(data)},{cells}")
    return "\r\n".join(lines) + "\r\n"


def vehicle_spy(frames: Frames) -> str:
    lines = [
        "Vehicle Spy 3 Data File, 3.9.0.38,,",
        "Line,Abs Time(Sec),Rel Time (Sec),Status,Er,Tx,Description,Network,Node,Arb ID,Remote,"
        "Xtd,B1,B2,B3,B4,B5,B6,B7,B8,Value,Trigger,Signals",
    ]
    for k, (t, channel, can_id, flags, data) in enumerate(rows(frames)):
        ext = "T" if flags & Flag.EXTENDED else "F"
        sent = "T" if flags & Flag.SENT else "F"
        cells = ",".join([f"{b:02X}" for b in data] + [""] * (8 - len(data)))
        seconds = f"{t // 10**9}.{t % 10**9:09d}"
        what = f'"HS CAN, ${can_id:X}"'
        network = ("HS CAN", "MS CAN 1")[channel]
        head = f"{k + 1},{seconds},0.01,67108866,F,{sent},{what},{network},,{can_id:X},F,{ext}"
        lines.append(f"{head},{cells},,,")
    return "\n".join(lines) + "\n"


def canalyzer(frames: Frames) -> str:
    lines = ["Time[s];Chn;ID;Name;Dir;DLC;Data length;Data"]
    for t, channel, can_id, flags, data in rows(frames):
        ext = "x" if flags & Flag.EXTENDED else ""
        way = "Tx" if flags & Flag.SENT else "Rx"
        seconds = f"{t // 10**9},{t % 10**9:09d}"
        code = int(LENGTH_CODE[len(data)])
        what = f"CAN {channel + 1};{can_id:X}{ext};Msg;{way};{code};{len(data)}"
        lines.append(f"{seconds};{what};{data.hex(' ')}")
    return "\n".join(lines) + "\n"


def crtd(frames: Frames) -> str:
    lines = ["1320745424.000 CXX OVMS CRTD", "1320745424.000 CVR 3.1"]
    for t, channel, can_id, flags, data in rows(frames):
        kind = ("T" if flags & Flag.SENT else "R") + ("29" if flags & Flag.EXTENDED else "11")
        wide = f"{can_id:08X}" if flags & Flag.EXTENDED else f"{can_id:03X}"
        lines.append(
            f"{t // 10**9}.{t % 10**9:09d} {channel + 1}{kind} {wide} {data.hex(' ').upper()}"
        )
    return "\n".join(lines) + "\n"


def busmaster(frames: Frames, mode: str = "SYSTEM", base: str = "HEX") -> str:
    from datetime import datetime

    start = datetime.fromtimestamp(int(frames.t_ns[0]) // 10**9)
    zero = datetime(start.year, start.month, start.day).timestamp() * 10**9
    lines = [
        "***BUSMASTER Ver 3.2.2***",
        "***PROTOCOL CAN***",
        f"***START DATE AND TIME {start:%-d:%-m:%Y %H:%M:%S}:000***",
        f"***{base}***",
        f"***{mode} MODE***",
        "***<Time><Tx/Rx><Channel><CAN ID><Type><DLC><DataBytes>***",
    ]
    last = int(start.timestamp()) * 10**9
    for t, channel, can_id, flags, data in rows(frames):
        since = t - (int(zero) if mode == "SYSTEM" else last)
        last = t if mode == "RELATIVE" else last
        units = since // 100_000
        clock = (
            f"{units // 36_000_000:02d}:{units // 600_000 % 60:02d}:{units // 10_000 % 60:02d}:"
            f"{units % 10_000:04d}"
        )
        way = "Tx" if flags & Flag.SENT else "Rx"
        kind = "x" if flags & Flag.EXTENDED else "s"
        number = f"0x{can_id:X}" if base == "HEX" else f"{can_id}"
        cells = data.hex(" ").upper() if base == "HEX" else " ".join(map(str, data))
        lines.append(f"{clock} {way} {channel + 1} {number} {kind} {len(data)} {cells}")
    return "\n".join([*lines, "***[STOP LOGGING SESSION]***"]) + "\n"


def same(given: Frames, expected: Frames, without: int = 0) -> None:
    np.testing.assert_array_equal(given.t_ns, expected.t_ns)
    np.testing.assert_array_equal(given.id, expected.id)
    np.testing.assert_array_equal(given.flags, expected.flags & ~np.uint8(without))
    np.testing.assert_array_equal(given.length, expected.length)
    np.testing.assert_array_equal(given.channel, expected.channel)
    width = min(given.data.shape[1], expected.data.shape[1])
    np.testing.assert_array_equal(given.data[:, :width], expected.data[:, :width])


TEXTS: dict[str, tuple[Callable[[Frames], str], Flag]] = {
    "gvret.csv": (gvret, Flag(0)),
    "native.csv": (native, Flag.SENT),
    "spy.csv": (vehicle_spy, Flag(0)),
    "canalyzer.csv": (canalyzer, Flag(0)),
    "a.crtd": (crtd, Flag(0)),
    "busmaster.log": (busmaster, Flag(0)),
}


@pytest.mark.parametrize("name", TEXTS)
def test_what_another_tool_writes(name, tmp_path):
    write, lost = TEXTS[name]
    frames = sample()
    path = written(tmp_path / name, write(frames))
    given = read_frames(path)
    same(given, frames, lost)
    assert given.absolute and not is_table(path)
    same(read_frames(written(tmp_path / "any.txt", write(frames))), frames, lost)
    two_byte = written(tmp_path / "wide.txt", write(frames).encode("utf-16"))
    same(read_frames(two_byte), frames, lost)


HEADERS = {
    "gvret": "Time Stamp,ID,Extended,Bus,LEN,D1" + ";x" * 20,
    "spy": "Line,Abs Time(Sec),Arb ID,Xtd,B1,B2" + ",x" * 2000 + ";x" * 3000,
    "named": "time;id;data" + ";x" * 2500 + ",x" * 4000,
}


@pytest.mark.parametrize("name", HEADERS)
def test_a_header_that_only_seems_to_be_one_is_refused_in_one_line(name, tmp_path):
    """It has more of another separator, some behind the bytes by which the format was known."""
    path = written(tmp_path / "a.csv", HEADERS[name] + "\n1;2;3\n")
    with pytest.raises(ClutchestError, match=r"a\.csv: .*expected") as caught:
        read_frames(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["gvret.csv", "canalyzer.csv", "a.crtd", "busmaster.log"])
def test_long_frames_of_can_fd(name, tmp_path):
    write, lost = TEXTS[name]
    frames = sample(fd=True)
    same(read_frames(written(tmp_path / name, write(frames))), frames, lost)


@pytest.mark.parametrize("mode", ["ABSOLUTE", "RELATIVE"])
@pytest.mark.parametrize("base", ["HEX", "DEC"])
def test_busmasters_clocks_and_bases(mode, base, tmp_path):
    frames = sample()
    same(read_frames(written(tmp_path / "b.log", busmaster(frames, mode, base))), frames)


def test_busmasters_remote_and_error_frames_and_midnight(tmp_path):
    head = busmaster(sample().take(slice(0, 1))).splitlines()[:6]
    lines = [
        "23:59:59:9999 Rx 1 0x123 s 1 07",
        "00:00:00:0001 Rx 1 0x123 sr 4",
        "00:00:00:0002 Rx 2 ERR Rx bit error",
        "00:00:00:0003 Rx 1 0xZZ s 1 07",
    ]
    frames = read_frames(written(tmp_path / "b.log", "\n".join([*head, *lines])))
    assert np.diff(frames.t_ns).tolist() == [200_000, 100_000]
    assert frames.flags.tolist() == [0, Flag.REMOTE, Flag.ERROR]
    assert frames.length.tolist() == [1, 4, 0] and frames.channel.tolist() == [0, 0, 1]
    assert dict(frames.rejected) == {"id is not a CAN id": 1}


def test_names_of_columns_decide(tmp_path):
    """Cabana's layout, decimal ids, milliseconds, remote frames, and rows that are cut off."""
    cabana = written(
        tmp_path / "a.csv", "time,addr,bus,data\n0.5,0x18fef100,1,0x0102\n0.6,291,0,ff\n"
    )
    frames = read_frames(cabana)
    assert frames.id.tolist() == [0x18FEF100, 0x291] and frames.channel.tolist() == [1, 0]
    assert frames.length.tolist() == [2, 1] and frames.t_ns.tolist() == [500_000_000, 600_000_000]
    text = (
        "Timestamp [ms]\tChannel\tID (dec)\tRTR\tDLC\tData\n"
        "1.5\t1\t291\t0\t2\t01 02\n2.5\t2\t291\t1\t4\t\n3.5\t1\t291\t0\t4\t01 02\n4.5\t1\t\n"
    )
    frames = read_frames(written(tmp_path / "b.csv", text))
    assert frames.t_ns.tolist() == [1_500_000, 2_500_000] and frames.id.tolist() == [291, 291]
    assert frames.flags.tolist() == [0, Flag.REMOTE] and frames.length.tolist() == [2, 4]
    assert sum(dict(frames.rejected).values()) == 2


def test_a_table_of_signals_is_no_log_of_frames(tmp_path):
    for header in ("time,engine_speed", "time,id,engine_speed", "time;data;value"):
        assert is_table(written(tmp_path / "a.csv", f"{header}\n0,1,2\n"))


# --- captures -------------------------------------------------------------------------------------


def socketcan(flags: Flag, can_id: int, data: bytes, order: str = ">") -> bytes:
    """A frame as Linux has it, the id in network order."""
    bits = can_id | (0x80000000 if flags & Flag.EXTENDED else 0)
    bits |= 0x40000000 if flags & Flag.REMOTE else 0
    fd = 4 if flags & Flag.FD else 0
    room = 64 if fd else 8
    return struct.pack(order + "IBBxx", bits, len(data), fd) + data.ljust(room, b"\0")


def pcap(frames: Frames, order: str = "<", ns: bool = False) -> bytes:
    out = struct.pack(order + "IHHiIII", 0xA1B23C4D if ns else 0xA1B2C3D4, 2, 4, 0, 0, 65535, 227)
    for t, _, can_id, flags, data in rows(frames):
        packet = socketcan(flags, can_id, data)
        part = t % 10**9 if ns else t % 10**9 // US
        out += struct.pack(order + "IIII", t // 10**9, part, len(packet), len(packet)) + packet
    return out


def block(kind: int, body: bytes, order: str = "<") -> bytes:
    body += b"\0" * (-len(body) % 4)
    size = struct.pack(order + "I", len(body) + 12)
    return struct.pack(order + "I", kind) + size + body + size


def pcapng(frames: Frames, order: str = "<", kind: int = 227) -> bytes:
    """An interface for each channel, times in ns."""
    out = block(0x0A0D0D0A, struct.pack(order + "IHHq", 0x1A2B3C4D, 1, 0, -1), order)
    ns = struct.pack(order + "HHBxxxHH", 9, 1, 9, 0, 0)
    for _ in range(2):
        out += block(1, struct.pack(order + "HHI", kind, 0, 65535) + ns, order)
    out += block(5, b"statistics..", order)
    for t, channel, can_id, flags, data in rows(frames):
        packet = socketcan(flags, can_id, data)
        if kind == 113:
            cooked = struct.pack(">HHH8sH", 1, 280, 0, b"", 13 if flags & Flag.FD else 12)
            packet = cooked + socketcan(flags, can_id, data, order)
        elif kind == 276:
            cooked = struct.pack(">HHIHBB8s", 13 if flags & Flag.FD else 12, 0, 3, 280, 1, 0, b"")
            packet = cooked + socketcan(flags, can_id, data, order)
        head = struct.pack(
            order + "IIIII", channel, t >> 32, t & 0xFFFFFFFF, len(packet), len(packet)
        )
        out += block(6, head + packet, order)
    return out


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("fd", [False, True])
def test_captures(order, fd, tmp_path):
    frames = sample(fd)
    frames = replace(frames, flags=frames.flags & ~np.uint8(Flag.SENT))
    for ns in (False, True):
        given = read_frames(written(tmp_path / "a.pcap", pcap(frames, order, ns)))
        same(given, replace(frames, channel=np.zeros(len(frames), np.uint8)))
    for kind in (227, 113, 276):
        same(read_frames(written(tmp_path / "a.pcapng", pcapng(frames, order, kind))), frames)


def test_a_capture_that_is_cut_or_holds_other_packets(tmp_path):
    frames = sample().take(slice(0, 20))
    whole = pcap(frames)
    cut = read_frames(written(tmp_path / "a.pcap", whole[:-5]))
    assert len(cut) == 19 and dict(cut.rejected) == {"packet is cut off": 1}
    other = whole + struct.pack("<IIII", 1, 0, 4, 4) + b"none"
    assert dict(read_frames(written(tmp_path / "b.pcap", other)).rejected) == {
        "no CAN frame in this packet": 1
    }
    huge = whole + struct.pack("<IIII", 1, 0, 1 << 30, 1 << 30)
    assert dict(read_frames(written(tmp_path / "c.pcap", huge)).rejected) == {"file is damaged": 1}


def test_captures_as_python_can_sends_them(tmp_path):
    """Remote frames, and an error frame, which has no id."""
    out = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 227)
    for bits, length in ((0x40000123, 4), (0x20000004, 8)):
        packet = struct.pack(">IBBxx8s", bits, length, 0, b"")
        out += struct.pack("<IIII", 1_700_000_000, 5, len(packet), len(packet)) + packet
    frames = read_frames(written(tmp_path / "a.pcap", out))
    assert frames.flags.tolist() == [Flag.REMOTE, Flag.ERROR]
    assert frames.id.tolist() == [0x123, 0] and frames.length.tolist() == [4, 0]
    assert frames.absolute


@pytest.mark.filterwarnings("ignore::Warning:asammdf")
@pytest.mark.parametrize("fd", [False, True])
def test_what_asammdf_exports_of_bus_logging(fd, tmp_path, monkeypatch):
    """By asammdf itself; with CAN FD it breaks every payload into several lines, some of them where
    a block ends."""
    from asammdf import MDF

    frames = random_frames(200, seed=3, fd=fd)
    data = (frames.flags & (Flag.REMOTE | Flag.ERROR)) == 0
    frames = replace(frames.take(data), absolute=False).sorted()
    frames = replace(frames, t_ns=(frames.t_ns - frames.t_ns.min()) // US * US)
    write_frames(frames, tmp_path / "a.mf4")
    with MDF(tmp_path / "a.mf4") as mdf:
        mdf.export("csv", tmp_path / "b.csv", single_time_base=True)
    monkeypatch.setattr(log_source, "BLOCK", 1 << 12)
    given = read_frames(tmp_path / "b.csv")
    np.testing.assert_allclose(given.t_ns, frames.t_ns, atol=1)
    for column in ("id", "flags", "length", "channel", "data"):
        a, b = getattr(given, column), getattr(frames, column)
        np.testing.assert_array_equal(a, b, err_msg=column)
    assert not given.rejected


def test_a_time_that_goes_on_behind_its_number_is_none(tmp_path):
    text = "Time,ID,DLC,Data\n0.5,123,2,01 02\n0.6x,123,2,01 02\n0.7 ,124,2,01 02\n"
    frames = read_frames(written(tmp_path / "a.csv", text))
    assert frames.id.tolist() == [0x123, 0x124]
    assert frames.rejected == (("time stamp cannot be read", 1),)


def test_a_date_of_busmaster_that_cannot_be_read_is_said(tmp_path):
    text = (
        "***BUSMASTER Ver 3.2.2***\n***PROTOCOL CAN***\n***[START LOGGING SESSION]***\n"
        "***START DATE AND TIME 2022-09-06 13:05:05***\n***HEX***\n***RELATIVE MODE***\n"
        "00:00:00:0000 Rx 1 0x123 s 2 01 02\n"
    )
    frames = read_frames(written(tmp_path / "a.log", text))
    assert not frames.absolute and "'2022-09-06 13:05:05' is not read" in frames.notes[0]
