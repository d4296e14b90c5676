"""Csv of frames as loggers, scripts and spreadsheets write them: names, numbers, times, words."""

from __future__ import annotations

import time
from datetime import UTC, datetime
from pathlib import Path

import pytest

from clutchest.can.files import read_frames
from clutchest.can.frames import Flag, Frames
from clutchest.errors import ClutchestError

S = 10**9


def read(folder: Path, text: str | bytes, name: str = "a.csv") -> Frames:
    path = folder / name
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return read_frames(path)


def data(frames: Frames) -> list[bytes]:
    return [bytes(frames.data[k, : frames.length[k]]) for k in range(len(frames))]


# --- times ----------------------------------------------------------------------------------------

NUMBERS = {
    "1e-05": 10_000,
    "1E-5": 10_000,
    "2.5e-06": 2_500,
    "-1e-05": -10_000,
    "0.30000000000000004": 300_000_000,
    "0.29999999999999999": 300_000_000,
    "+0.5": 500_000_000,
    "12.": 12 * S,
    "1.5e+01": 15 * S,
    "1700000000.123456789": 1_700_000_000_123_456_789,
    "1.700000000123e9": 1_700_000_000_123_000_000,
    "1.7e+09": 1_700_000_000 * S,
    "0e5": 0,
}


@pytest.mark.parametrize("number", NUMBERS)
def test_times_as_programs_write_numbers(number, tmp_path):
    frames = read(tmp_path, f"Time,ID,DLC,Data\n{number},123,2,01 02\n")
    assert frames.t_ns.tolist() == [NUMBERS[number]] and not frames.rejected


@pytest.mark.parametrize("number", ["1e99", "9" * 25, "1e", "--1", ".", "0x12", "1.2.3"])
def test_no_times(number, tmp_path):
    text = f"Time,ID,DLC,Data\n0.5,123,2,01 02\n{number},123,2,01 02\n"
    frames = read(tmp_path, text)
    assert frames.t_ns.tolist() == [S // 2]
    assert frames.rejected == (("time stamp cannot be read", 1),)


UNITS = {
    "Time [ms]": 1_000_000,
    "time_ms": 1_000_000,
    "Timestamp(us)": 1_000,
    "timestamp_ns": 1,
    "Time Stamp (µs)": 1_000,
    "Time [μs]": 1_000,
    "Time (sec)": S,
    "time_s": S,
    "Time (seconds)": S,
    "Timestamp (microseconds)": 1_000,
    "Zeit[ms]": 1_000_000,
    "TimestampEpoch": S,
    "timestamps": S,
    "Time": S,
}


@pytest.mark.parametrize("name", UNITS)
@pytest.mark.parametrize("encoding", ["utf-8", "latin-1", "utf-16"])
def test_units_of_times(name, encoding, tmp_path):
    text = f"{name},ID,DLC,Data\n1500,123,2,01 02\n"
    if encoding == "latin-1" and "μ" in name:
        pytest.skip("has no Greek letters")
    frames = read(tmp_path, text.encode(encoding))
    assert frames.t_ns.tolist() == [1500 * UNITS[name]]


@pytest.mark.parametrize("digits", [0, 3, 6, 9])
def test_times_since_1970_without_a_unit(digits, tmp_path):
    stamp = f"17{'0' * (8 + digits)}"
    frames = read(tmp_path, f"timestamp,id,dlc,data\n{stamp},123,2,0102\n")
    assert frames.t_ns.tolist() == [1_700_000_000 * S] and frames.absolute


UTC_NS = round(datetime(2023, 11, 20, 10, 13, 20, 500_000, UTC).timestamp() * 10) * S // 10
DATES = {
    "2023-11-20T10:13:20.5Z": 0,
    "2023-11-20 10:13:20,5+00:00": 0,
    "2023-11-20T11:13:20.500+01:00": 0,
    "2023-11-20T04:43:20.5-0530": 0,
    "2023/11/20 10:13:20.5": 1,
    "20.11.2023 10:13:20.500000": 1,
    "2023-11-20T10:13:20.500000000": 1,
}


@pytest.mark.skipif(not hasattr(time, "tzset"), reason="needs POSIX time zones")
@pytest.mark.parametrize("date", DATES)
def test_dates_are_of_their_zone_or_of_this_machines(date, tmp_path, monkeypatch):
    monkeypatch.setenv("TZ", "CET-1CEST,M3.5.0,M10.5.0/3")
    time.tzset()
    try:
        frames = read(tmp_path, f"Time;ID;DLC;Data\n{date};123;2;01 02\n")
    finally:
        monkeypatch.undo()
        time.tzset()
    assert frames.t_ns.tolist() == [UTC_NS - DATES[date] * 3600 * S] and frames.absolute


def test_times_of_day_go_on_behind_midnight(tmp_path):
    lines = ["23:59:59.5", "0:00:00.25", "00:00:01"]
    text = "".join(f"{stamp},123,1,01\n" for stamp in lines)
    frames = read(tmp_path, "Time,ID,DLC,Data\n" + text)
    assert [(t - frames.t_ns[0]) / S for t in frames.t_ns] == [0.0, 0.75, 1.5]
    assert not frames.absolute


@pytest.mark.parametrize("words", ["1/2/2024 10:13:20", "noon", "01T000000683"])
def test_times_that_may_be_anything_are_refused(words, tmp_path):
    with pytest.raises(ClutchestError, match=r"a\.csv: the time of a frame is '.*; expected"):
        read(tmp_path, f"Time,ID,DLC,Data\n{words},123,2,01 02\n")


def test_a_date_that_is_none_is_counted(tmp_path):
    good = "2023-11-20T10:13:20Z,123,1,01\n"
    bad = ["2023-13-20T10:13:20Z", "2023-11-20T25:13:20Z", "2023-11-20", "9999-01-01T00:00:00Z"]
    text = "".join(f"{stamp},123,1,01\n" for stamp in bad)
    frames = read(tmp_path, "Time,ID,DLC,Data\n" + good + text)
    assert len(frames) == 1 and frames.rejected == (("time stamp cannot be read", 4),)


# --- ids ------------------------------------------------------------------------------------------

IDS = {
    "0x18FEF100": (0x18FEF100, Flag.EXTENDED),
    "18FEF100x": (0x18FEF100, Flag.EXTENDED),
    "18fef100h": (0x18FEF100, Flag.EXTENDED),
    "$123": (0x123, Flag(0)),
    "0X7FF": (0x7FF, Flag(0)),
    "0x00000123": (0x123, Flag(0)),
    "123x": (0x123, Flag.EXTENDED),
    '"7E8"': (0x7E8, Flag(0)),
}


@pytest.mark.parametrize("written", IDS)
def test_ids(written, tmp_path):
    frames = read(tmp_path, f"Time,ID,DLC,Data\n0.5,{written},2,01 02\n")
    assert (frames.id[0], frames.flags[0]) == IDS[written]


@pytest.mark.parametrize("written", ["12G", "20000000", "123 4", "-1", "0x"])
def test_no_ids(written, tmp_path):
    frames = read(tmp_path, f"Time,ID,DLC,Data\n0.5,7E8,1,01\n0.5,{written},2,01 02\n")
    assert frames.id.tolist() == [0x7E8] and frames.rejected == (("id is not a CAN id", 1),)


@pytest.mark.parametrize("ids", [(419356416, 291), (291, 1345, 2024)])
def test_ids_that_can_only_be_decimal(ids, tmp_path):
    """As scripts write them: as hexadecimal they would be too large, or have four digits."""
    rows = "".join(f"{k},{i},1,01\n" for k, i in enumerate(ids))
    frames = read(tmp_path, "time,arbitration_id,dlc,data\n" + rows)
    assert frames.id.tolist() == list(ids) and "decimal" in frames.notes[0]
    assert (frames.flags & Flag.EXTENDED).tolist() == [int(i > 0x7FF) for i in ids]


@pytest.mark.parametrize("header", ["ID (hex),ID (dec)", "ID (dec),ID (hex)"])
def test_of_two_columns_of_ids_the_first_counts(header, tmp_path):
    ids = "7E8,2024" if header.startswith("ID (hex)") else "2024,7E8"
    frames = read(tmp_path, f"Time,{header},DLC,Data\n0.5,{ids},1,01\n")
    assert frames.id.tolist() == [0x7E8]


def test_ids_that_may_be_hexadecimal_are(tmp_path):
    rows = "".join(f"{k},{i},1,01\n" for k, i in enumerate(("0123", "18242100", "2345")))
    frames = read(tmp_path, "time,id,dlc,data\n" + rows)
    assert frames.id.tolist() == [0x123, 0x18242100, 0x2345] and not frames.notes


# --- payloads -------------------------------------------------------------------------------------

PAYLOADS = [
    "01 02 FF",
    "0102ff",
    "0x0102FF",
    "0x01 0x02 0xFF",
    "01-02-FF",
    "01:02:FF",
    "1 2 ff",
    '"01,02,FF"',
    '"[1, 2, 255]"',
    "[1 2 255]",
    " 01 02 FF ",
]


@pytest.mark.parametrize("written", PAYLOADS)
def test_payloads(written, tmp_path):
    frames = read(tmp_path, f"Time,ID,Data,Dir\n0.5,123,{written},Tx\n")
    assert data(frames) == [b"\x01\x02\xff"] and frames.flags.tolist() == [Flag.SENT]


def test_decimal_bytes_that_the_header_states(tmp_path):
    frames = read(tmp_path, "Time;ID (hex);DLC;Data (dec)\n0.5;7E8;3;1 20 255\n")
    assert data(frames) == [b"\x01\x14\xff"] and frames.id.tolist() == [0x7E8]
    names = ";".join(f"Byte {k} (dec)" for k in range(3))
    frames = read(tmp_path, f"Time;ID;DLC;{names}\n0.5;7E8;3;1;20;255\n")
    assert data(frames) == [b"\x01\x14\xff"]


def test_half_a_byte_and_rows_that_end_early_are_counted(tmp_path):
    text = "Time,ID,Data\n0.5,123,0102\n0.6,123,010\n0.7,123\n0.8\n0.9,123,300\n1.0,123,"
    frames = read(tmp_path, text)
    assert frames.t_ns.tolist() == [S // 2, S] and frames.length.tolist() == [2, 0]
    assert sum(dict(frames.rejected).values()) == 4


def test_payloads_over_several_lines_end_where_a_bracket_is_missing(tmp_path):
    text = "timestamps,ID,DataLength,Data\n0.5,291,3,[1\n 2\n 3]\n0.6,291,2,[1\n0.7,291,1,[7]\n"
    frames = read(tmp_path, text)
    assert data(frames)[0] == b"\x01\x02\x03" and data(frames)[-1] == b"\x07"
    assert frames.t_ns.tolist() == [S // 2, 7 * S // 10]


# --- words ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("way", ["Tx", "TX", "T", "1", "true", "Transmit", "Sent", "Out", "TxRq"])
def test_words_for_sent(way, tmp_path):
    frames = read(tmp_path, f"Time,ID,Dir,DLC,Data\n0.5,123,{way},1,01\n0.6,123,Rx,1,01\n")
    assert frames.flags.tolist() == [Flag.SENT, 0]


@pytest.mark.parametrize("way", ["Rx", "R", "0", "false", "Receive", "In", "", "rx"])
def test_words_for_received(way, tmp_path):
    frames = read(tmp_path, f"Time,ID,Dir,DLC,Data\n0.5,123,{way},1,01\n")
    assert frames.flags.tolist() == [0]


@pytest.mark.parametrize(
    "mark", ["1", "true", "T", "x", "X", "Ext", "extended", "29", "29-bit", "y"]
)
def test_words_for_29_bits(mark, tmp_path):
    frames = read(tmp_path, f"Time,ID,Extended,DLC,Data\n0.5,123,{mark},1,01\n")
    assert frames.flags.tolist() == [Flag.EXTENDED]


@pytest.mark.parametrize("mark", ["0", "false", "F", "", "Std", "standard", "11", "11-bit", "n"])
def test_words_for_11_bits(mark, tmp_path):
    frames = read(tmp_path, f"Time,ID,Extended,DLC,Data\n0.5,123,{mark},1,01\n")
    assert frames.flags.tolist() == [0]


KINDS = {
    "Data": Flag(0),
    "CAN": Flag(0),
    "Remote Frame": Flag.REMOTE,
    "RTR": Flag.REMOTE,
    "Error Frm.": Flag.ERROR,
    "Ext": Flag.EXTENDED,
    "Std": Flag(0),
    "FD": Flag.FD,
    "Rx": Flag(0),
    "Received": Flag(0),
    "RR": Flag.REMOTE,
    "Tx": Flag.SENT,
    "Transmit": Flag.SENT,
    "R": Flag(0),
    "": Flag(0),
}


@pytest.mark.parametrize("kind", KINDS)
def test_words_for_kinds_of_frames(kind, tmp_path):
    frames = read(tmp_path, f"Time,Type,ID,DLC,Data\n0.5,{kind},123,0,\n")
    assert frames.flags.tolist() == [KINDS[kind]]


def test_remote_and_error_frames_by_words_in_other_columns(tmp_path):
    text = (
        "Time,ID,DLC,Data\n0.5,123,4,RTR\n0.6,ErrorFrame,0,\n0.7,123,2,Remote Frame\n0.8,123,1,07\n"
    )
    frames = read(tmp_path, text)
    assert frames.flags.tolist() == [Flag.REMOTE, Flag.ERROR, Flag.REMOTE, 0]
    assert frames.id.tolist() == [0x123, 0, 0x123, 0x123] and frames.length.tolist() == [4, 0, 2, 1]


CHANNELS = {
    ("0", "1"): [0, 1],
    ("1", "2"): [0, 1],
    ("can0", "can1"): [0, 1],
    ("CAN 1", "CAN 2"): [0, 1],
    ("HS CAN", "MS CAN 1"): [0, 0],
    ("2", "2"): [1, 1],
}


@pytest.mark.parametrize("names", CHANNELS)
def test_channels_count_from_0_or_1(names, tmp_path):
    rows = "".join(f"{k},{name},123,1,01\n" for k, name in enumerate(names))
    frames = read(tmp_path, "Time,Channel,ID,DLC,Data\n" + rows)
    assert frames.channel.tolist() == CHANNELS[names]


# --- layouts --------------------------------------------------------------------------------------

TABLE = [
    ["Time", "Kanal", "ID", "Richtung", "Länge", "Daten"],
    ["0.5", "1", "7E8", "Tx", "2", "01 02"],
    ["0.6", "2", "18FEF100", "Rx", "1", "07"],
]


@pytest.mark.parametrize("separator", [",", ";", "\t", "|"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("encoding", ["utf-8-sig", "latin-1", "utf-16", "utf-16-le"])
@pytest.mark.parametrize("quote", ["", '"'])
def test_separators_line_ends_encodings_and_quotes(separator, end, encoding, quote, tmp_path):
    lines = (separator.join(f"{quote}{cell}{quote}" for cell in row) for row in TABLE)
    frames = read(tmp_path, end.join(lines).encode(encoding), "a.txt")
    assert frames.t_ns.tolist() == [S // 2, 6 * S // 10]
    assert data(frames) == [b"\x01\x02", b"\x07"] and frames.channel.tolist() == [0, 1]
    assert frames.flags.tolist() == [Flag.SENT, Flag.EXTENDED] and not frames.rejected


def test_what_else_stands_in_a_file(tmp_path):
    """An index, columns twice, words before the header, comments and blank lines."""
    text = (
        "Logger 5, serial 17\nvalues: hex\n"
        ",Time,Timestamp,ID,Data,DLC,Data,Info\n"
        '0,0.5,99,7E8,01 02,2,ff,"hello, world"\n'
        "\n# pause\n"
        '1,0.6,99,7E8,03 04,2,ff,"x"\n'
    )
    frames = read(tmp_path, text)
    assert frames.t_ns.tolist() == [S // 2, 6 * S // 10] and data(frames) == [
        b"\x01\x02",
        b"\x03\x04",
    ]
    assert sum(dict(frames.rejected).values()) == 1


@pytest.mark.parametrize("text", ["", " \n\n", "Time,ID,DLC,Data\n", "Time,ID,DLC,Data\n1,2"])
def test_nothing_to_read_is_an_error_in_one_line(text, tmp_path):
    with pytest.raises(ClutchestError, match=r"a\.csv: ") as caught:
        read(tmp_path, text)
    assert "\n" not in str(caught.value)
