"""Inputs that would need time or memory without end: refused in one line, before the work."""

from __future__ import annotations

import gzip
import json
import sqlite3
from contextlib import nullcontext
from struct import pack

import numpy as np
import pandas as pd
import pytest

import clutchest
from clutchest import budgets
from clutchest.can.database import load
from clutchest.can.files import read_frames
from clutchest.can.recovery import dbc
from clutchest.can.recovery.mf4_links import returning
from clutchest.errors import ClutchestError
from clutchest.reading.inspection import inspect_logs
from clutchest.record.files import read_state
from clutchest.shipped import locate, shipped
from clutchest.vehicle import load_vehicle
from fuzz.kinds import SEEDS

TRUCK = locate("truck", "vehicles").read_text(encoding="utf-8")
DBC = (
    shipped("dbc")["hdt_clutch"].read_text(encoding="utf-8")
    if "hdt_clutch" in shipped("dbc")
    else (
        next(p for p in shipped("dbc").values() if "hdt_clutch" in p.name).read_text(
            encoding="utf-8"
        )
    )
)


def refusal(what, *arguments) -> str:
    with pytest.raises(ClutchestError) as caught:
        what(*arguments)
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 500
    return str(caught.value)


NUMBERS = {
    "400 digits": ("engine_inertia = { value = 3.2", f"engine_inertia = {{ value = {'9' * 400}"),
    "5000 digits": ("engine_inertia = { value = 3.2", f"engine_inertia = {{ value = {'9' * 5000}"),
    "1e300": ("noise = 0.06", "noise = 1e300"),
    "late": ("noise = 0.06", "noise = 0.06\ndelay = 1e6"),
    "nested": ('name = "truck"', f"name = {'[' * 2000}{']' * 2000}"),
    "deeper": ('name = "truck"', f"name = {'{a=' * 400}1{'}' * 400}"),
}


@pytest.mark.parametrize("what", NUMBERS)
def test_a_vehicle_file_is_refused_with_its_line(tmp_path, what):
    old, new = NUMBERS[what]
    text = TRUCK.replace(old, new, 1)
    assert text != TRUCK
    path = tmp_path / "v.toml"
    path.write_text(text, encoding="utf-8")
    line = text[: text.index(new)].count("\n") + new.count("\n") + 1
    assert refusal(load_vehicle, path).startswith(f"v.toml:{line}: ")


def test_a_vehicle_file_of_many_megabytes_is_not_read(tmp_path):
    path = tmp_path / "v.toml"
    path.write_text(TRUCK + "# \n" * (budgets.VEHICLE_BYTES // 3))
    assert "are too many for a vehicle file" in refusal(load_vehicle, path)


PLACES = {
    "start": ("24|16@1+", "4000000000|16@1+"),
    "width": ("24|16@1+", "24|99999999999999999999@1+"),
    "scale": ("24|16@1+ (0.125,0)", f"24|16@1+ ({'9' * 400},0)"),
    "offset": ("24|16@1+ (0.125,0)", "24|16@1+ (0.125,1e999)"),
}


@pytest.mark.parametrize("what", PLACES)
def test_a_signal_that_no_message_holds_is_refused_with_its_line(tmp_path, what):
    old, new = PLACES[what]
    assert old in DBC
    path = tmp_path / "x.dbc"
    path.write_text(DBC.replace(old, new, 1), encoding="utf-8")
    line = DBC[: DBC.index(old)].count("\n") + 1
    assert f"line {line}" in refusal(load, [path])


def test_a_long_dbc_with_a_quote_that_does_not_close_is_refused(tmp_path):
    path = tmp_path / "x.dbc"
    path.write_text(DBC + 'CM_ "' + "word " * (1 << 18), encoding="utf-8")
    assert "a quote that does not close" in refusal(load, [path])
    path.write_text(DBC + "\n" * budgets.DBC_BYTES, encoding="utf-8")
    assert "are too many for a DBC" in refusal(load, [path])


BUS = {path.suffix[1:]: path.read_text(encoding="utf-8") for path in SEEDS.glob("bus.*")}
GIANTS = {
    "sym length": ("sym", "Len=8", "Len=200000000"),
    "sym signal": ("sym", "unsigned 16", "unsigned\n2000000000"),
    "sym place": ("sym", '"EngineSpeed" 24', '"EngineSpeed" 2000000000'),
    "kcd length": ("kcd", 'length="8"', 'length="200000000"'),
    "kcd signal": ("kcd", 'length="16"', "length\n=\n'2000000000'"),
    "kcd place": ("kcd", 'offset="24"', 'offset="&#50;000000000"'),
    "kcd entities": ("kcd", "<NetworkD", '<!DOCTYPE n [<!ENTITY a "9">]>\n<NetworkD'),
    "arxml frame": ("arxml", "<FRAME-LENGTH>8<", "<FRAME-LENGTH>200000000<"),
    "arxml pdu": ("arxml", "<LENGTH>8<", "<LENGTH>2e8<"),
    "arxml signal": ("arxml", "<LENGTH>16<", "<LENGTH>0x77359400<"),
    "arxml place": ("arxml", "POSITION>24<", "POSITION><![CDATA[2000000000]]><"),
    "arxml place with a child": ("arxml", "POSITION>24<", "POSITION>20000<!-- -->00000<X/><"),
    "arxml selector": ("arxml", "FIELD-LENGTH>8<", "FIELD-LENGTH>&#50;000000000<"),
    "arxml entities": ("arxml", "<AUTOSAR", '<!DOCTYPE n [<!ENTITY a "9">]>\n<AUTOSAR'),
    "power of ten": ("dbc", "INT 0 65535", "INT 0 61e3085535"),
    "power in quotes": ("dbc", '"GenMsgCycleTime" 100', '"GenMsgCycleTime" "1e99999999"'),
    "digits": ("dbc", '"GenMsgCycleTime" 100', f'"GenMsgCycleTime" {"9" * 100_000}'),
    "dbc place": ("dbc", "24|16@1+", "\n2000000000|16@1+"),
}


@pytest.mark.parametrize("what", GIANTS)
def test_places_beyond_any_message_are_refused_with_their_line(tmp_path, what):
    kind, old, new = GIANTS[what]
    path = tmp_path / f"x.{kind}"
    path.write_text(BUS[kind], encoding="utf-8")
    assert load([path]).messages
    path.write_text(BUS[kind].replace(old, new, 1), encoding="utf-8")
    assert old in BUS[kind] and f"x.{kind}, line " in refusal(load, [path])


def test_an_arxml_whose_parts_lead_to_each_other_without_end_is_refused(tmp_path):
    """Each of thirty multiplexed PDUs refers twice to the next one: a thousand million ways."""
    start = BUS["arxml"].index("<MULTIPLEXED-I-PDU>")
    end = BUS["arxml"].index("</MULTIPLEXED-I-PDU>") + len("</MULTIPLEXED-I-PDU>")
    one = BUS["arxml"][start:end].replace("I-SIGNAL-I-PDU", "MULTIPLEXED-I-PDU")
    levels = [
        one.replace("BranchedPdu", "BranchedPdu" if level == 0 else f"Level{level}")
        .replace("GearPdu", f"Level{level + 1}")
        .replace("PositionPdu", f"Level{level + 1}")
        for level in range(30)
    ]
    path = tmp_path / "x.arxml"
    path.write_text(BUS["arxml"][:start] + "".join(levels) + BUS["arxml"][end:])
    assert "refer to each other in more than" in refusal(load, [path])


LEFT_OUT = {
    "length": ("Branched: 8", "Branched: 200000000", {"EEC1"}),
    "length in a line of its own": ("Branched: 8", "Branched:\n200000000", {"EEC1"}),
    "range": ("2-3, 5-5", "2-3000000000", {"EEC1", "Branched"}),
    "many ranges": ("2-3, 5-5", "0-99999, " * 9 + "0-1", {"EEC1", "Branched"}),
    "digits": ("2-3, 5-5", "2-" + "9" * 5000, {"EEC1", "Branched"}),
    "a word like a number": ("all of it", "part 12E10000 of 1e10000 and 1", None),
    "only words": ('CM_ "all of it"', 'CM_ "BO_ 9 X: 200000000 SG_ A : 9999999|1@1+ (1,0)"', None),
}


@pytest.mark.parametrize("what", LEFT_OUT)
def test_what_a_dbc_has_too_large_is_left_out_and_said(tmp_path, what):
    old, new, left = LEFT_OUT[what]
    path = tmp_path / "x.dbc"
    path.write_text(BUS["dbc"].replace(old, new, 1), encoding="utf-8")
    database = load([path])
    assert old in BUS["dbc"] and set(database.messages) == (left or {"EEC1", "Branched"})
    assert any("left out: " in warning for warning in database.warnings) == (left is not None)


def test_a_dbc_of_which_nothing_is_left_is_refused(tmp_path):
    path = tmp_path / "x.dbc"
    path.write_text('BO_ 256\n X:\n 200000000 Y\n SG_ A : 0|8@1+ (1,0) [0|0] "" Y')
    refusal(load, [path])


@pytest.mark.parametrize("text", ["", "\ufeff", " \n\n"])
def test_an_empty_dbc_is_refused(tmp_path, text):
    path = tmp_path / "x.dbc"
    path.write_text(text, encoding="utf-8")
    assert "the file is empty" in refusal(load, [path])


def test_a_long_dbc_is_not_repaired_without_end(tmp_path, monkeypatch):
    monkeypatch.setattr(dbc, "REPAIRED_BYTES", 5 * len(DBC))
    path = tmp_path / "x.dbc"
    path.write_text(DBC + "EV_ wrong ;\n" * 3, encoding="utf-8")
    assert load([path]).messages
    path.write_text(DBC + "EV_ wrong ;\n" * 40, encoding="utf-8")
    assert "lines are not valid" in refusal(load, [path])


def test_a_range_of_all_numbers_is_no_defect(tmp_path):
    path = tmp_path / "x.dbc"
    path.write_text(
        DBC.replace("[0|8031.875]", "[-1.79769313486232E+308|1.79769313486232E+308]", 1)
    )
    assert load([path]).messages


def test_an_error_is_one_line_whatever_it_quotes(tmp_path):
    assert (
        str(ClutchestError("x.dbc: unused entries:\n    VAL_ 1\n"))
        == "x.dbc: unused entries: VAL_ 1"
    )


VIEWS = {
    "endless": "CREATE VIEW messages AS WITH RECURSIVE r(ts) AS (SELECT 0 UNION ALL SELECT ts + 1 "
    "FROM r) SELECT ts, 1, 0, 0, 0, 8, x'00' FROM r",
    "giant": "CREATE VIEW messages AS SELECT 0 AS ts, 1 AS arbitration_id, 0 AS extended, 0 AS "
    "remote, 0 AS error, 8 AS dlc, zeroblob(900000000) AS data",
    "generated": "CREATE TABLE messages (ts REAL, arbitration_id INTEGER, extended INTEGER, remote "
    "INTEGER, error INTEGER, dlc INTEGER, data BLOB GENERATED ALWAYS AS (zeroblob(900000000)))",
}


@pytest.mark.parametrize("what", VIEWS)
def test_rows_that_a_database_makes_itself_are_not_read(tmp_path, what):
    path = tmp_path / "x.db"
    with sqlite3.connect(path) as database:
        database.execute(VIEWS[what])
    database.close()
    assert "expected a plain table" in refusal(read_frames, path)


def test_a_giant_value_in_a_database_is_not_fetched(tmp_path):
    path = tmp_path / "x.db"
    with sqlite3.connect(path) as database:
        database.execute(
            "CREATE TABLE messages (ts REAL, arbitration_id INTEGER, extended INTEGER, remote "
            "INTEGER, error INTEGER, dlc INTEGER, data BLOB)"
        )
        database.execute("INSERT INTO messages VALUES (0, 1, 0, 0, 0, 8, zeroblob(10000000))")
    database.close()
    assert "no CAN frame could be read" in refusal(read_frames, path)


def block(kind: bytes, *links: int) -> bytes:
    return pack("<4sIQQ", kind, 0, 24 + 8 * len(links), len(links)) + pack(
        f"<{len(links)}Q", *links
    )


@pytest.mark.parametrize(
    ("blocks", "place"),
    [
        ([block(b"##HD", 112, 0, 0, 0, 0, 0), block(b"##DG", 0, 0, 0, 0)], None),
        ([block(b"##HD", 136, 0, 0, 0, 0, 0), block(b"##DG", 136, 0, 0, 0)], 136),
        (
            [
                block(b"##HD", 136, 0, 0, 0, 0, 0),
                block(b"##DG", 0, 192, 0, 0),
                block(b"##CG", 136, 0, 0, 0, 0, 0),
            ],
            136,
        ),
        ([block(b"##HD", 0, 136, 0, 0, 0, 0), block(b"##FH", 136, 0)], 136),
        ([block(b"##HD", 10**15, 0, 0, 0, 0, 0)], None),
        (
            [block(b"##HD", 136, 0, 0, 0, 0, 0), block(b"none", 0, 192, 0, 0), block(b"none", 192)],
            192,
        ),
        ([block(b"##HD", 136, 0, 0, 0, 0, 0), block(b"none", 136)], 136),
    ],
)
def test_chains_that_return_are_found(tmp_path, blocks, place):
    path = tmp_path / "x.mf4"
    path.write_bytes(b"\0" * 64 + b"".join(blocks))
    with path.open("rb") as file:
        assert returning(file) == place


def test_blocks_count_as_often_as_they_are_reached(tmp_path):
    def conversions(count):  # each refers twice to the next
        places = [136 + 72 * k for k in range(count)]
        return [block(b"##CC", 0, 0, 0, 0, p + 72, p + 72) for p in places]

    path = tmp_path / "x.mf4"
    head = block(b"##HD", 0, 0, 136, 0, 0, 0)
    for count, many in ((15, False), (40, True)):
        path.write_bytes(b"\0" * 64 + head + b"".join(conversions(count)))
        with path.open("rb") as file, pytest.raises(OverflowError) if many else nullcontext():
            assert returning(file) is None


CANDUMP = b"(1700000000.%06d) can0 0CF00400#F07D7D102700F07D\n"


@pytest.mark.parametrize("budget", ["LOG_FRAMES", "LOG_RATIO", "HELD_BYTES"])
@pytest.mark.parametrize("read", [inspect_logs, clutchest.read_log])
def test_a_log_that_inflates_to_too_many_frames_is_refused(tmp_path, monkeypatch, budget, read):
    path = tmp_path / "x.log.gz"
    path.write_bytes(gzip.compress(b"".join(CANDUMP % (k // 100) for k in range(2000)), mtime=0))
    assert path.stat().st_size < 1000
    small = {"LOG_FRAMES": 1000, "LOG_RATIO": (50_000, 1), "HELD_BYTES": (23_000, 1)}
    monkeypatch.setattr(budgets, budget, small[budget])
    arguments = ([path],) if read is inspect_logs else (path, "truck")
    assert "million frames; expected fewer of a file of" in refusal(read, *arguments)
    path.with_suffix("").write_bytes(gzip.decompress(path.read_bytes()))
    assert read(*([path.with_suffix("")] if k == 0 else a for k, a in enumerate(arguments)))


def drive(rows=600) -> pd.DataFrame:
    time = np.arange(rows) * 0.1
    return pd.DataFrame(
        {
            "time": time,
            "engine_speed": 100.0 + np.sin(time),
            "engine_torque": 500.0 + 100.0 * np.sin(time),
            "input_shaft_speed": 100.0 + np.sin(time),
        }
    )


@pytest.mark.parametrize("late", [1e7, 1e9, 1e300, -1e300])
@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_a_late_row_is_no_end_of_the_drive(tmp_path, late, suffix):
    table = drive()
    table.loc[300, "time"] = late
    path = tmp_path / f"drive.{suffix}"
    table.to_csv(path, index=False) if suffix == "csv" else table.to_parquet(path)
    first = clutchest.read_log(path, "truck").drives[0]
    assert first.end < 61.0 and len(first["engine_speed"]) == 599


def test_a_table_without_a_time_that_can_be_told_is_refused(tmp_path):
    table = drive()
    table["time"] += 1e200
    table.to_parquet(tmp_path / "drive.parquet")
    assert "times beyond 7e+09 s" in refusal(
        clutchest.read_log, tmp_path / "drive.parquet", "truck"
    )


def test_tables_that_inflate_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(budgets, "TABLE_CELLS", 100_000)
    monkeypatch.setattr(budgets, "LINE_BYTES", 1 << 20)
    rows = "time,engine_speed\n" + "1.0,100.0\n" * 500_000
    with gzip.open(tmp_path / "long.csv.gz", "wt") as file:
        file.write(rows)
    with gzip.open(tmp_path / "line.csv.gz", "wt") as file:
        file.write("time,engine_speed\n" + "1" * (4 << 20))
    constant = pd.DataFrame({"time": np.zeros(200_000), "engine_speed": np.zeros(200_000)})
    constant.to_parquet(tmp_path / "constant.parquet")
    for name in ("long.csv.gz", "line.csv.gz", "constant.parquet"):
        assert "holds more than" in refusal(clutchest.read_log, tmp_path / name, "truck"), name


@pytest.mark.parametrize(
    "text", ["[" * 100_000, '{"a":' * 100_000, '{"x": ' + "9" * 5000 + "}", '"x"', "{"]
)
def test_a_hostile_state_is_one_line(tmp_path, text):
    path = tmp_path / "state.json"
    path.write_text(text)
    assert str(path) in refusal(read_state, path)


@pytest.fixture(scope="module")
def left():
    return clutchest.replay(clutchest.read_log("demo", "truck"), "truck").final


STATES = {
    "digits in x": lambda s: s["x"].__setitem__(0, 10**400),
    "digits in inputs": lambda s: s["inputs"].__setitem__("coolant_temp", 10**400),
    "digits in history": lambda s: s["history"].__setitem__("driven_s", 10**400),
    "time": lambda s: s.__setitem__("time_ns", -(10**400)),
    "variance": lambda s: s["slip_energy"].__setitem__(1, -1.0),
    "indefinite": lambda s: (s["P"][0].__setitem__(1, 1e6), s["P"][1].__setitem__(0, 1e6)),
    "asymmetric": lambda s: s["P"][0].__setitem__(1, 1e3),
    "words": lambda s: s.__setitem__("x", "many"),
    "numbers in quotes": lambda s: s.__setitem__("x", [str(value) for value in s["x"]]),
}


@pytest.mark.parametrize("what", STATES)
def test_a_damaged_state_is_said(left, what):
    state = json.loads(json.dumps(left))
    STATES[what](state)
    assert "damaged" in refusal(lambda: clutchest.replay(_demo(), "truck", state=state))


def _demo():
    return clutchest.read_log("demo", "truck")
