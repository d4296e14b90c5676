from __future__ import annotations

import sys
from pathlib import Path

import pytest

from clutchest.can.database import DatabaseFile, load
from clutchest.can.files import read_frames
from clutchest.errors import ClutchestError
from clutchest.shipped import locate, shipped

HEAD = 'VERSION ""\nBS_:\nBU_: A\n'
ONE = HEAD + 'BO_ 100 One: 2 A\n SG_ S : 0|8@1+ (0.5,-3) [0|10] "°C" A\n'


def test_the_layout_is_frozen(truck):
    message = truck.message("EEC1")
    assert (message.id, message.extended, message.length) == (0x0CF00400, True, 8)
    assert message.is_j1939 and message.cycle_time_s == 0.01
    speed = message.signal("EngineSpeed")
    assert (speed.start, speed.width, speed.scale, speed.unit) == (24, 16, 0.125, "rpm")
    assert (speed.spn, speed.minimum, speed.maximum) == (190, 0, 8031.875)
    with pytest.raises(AttributeError):
        speed.start = 0


def test_a_cycle_time_that_is_a_text_is_none(tmp_path):
    path = tmp_path / "x.dbc"
    path.write_text(
        ONE + 'BA_DEF_ BO_ "GenMsgCycleTime" STRING ;\nBA_DEF_DEF_ "GenMsgCycleTime" "";\n'
        'BA_ "GenMsgCycleTime" BO_ 100 "10";\n'
    )
    assert load([path]).message("One").cycle_time_s is None


def test_shipped_cycle_times(truck):
    assert {name: message.cycle_time_s for name, message in truck.messages.items()} == {
        "EEC1": 0.01,
        "EEC3": 0.25,
        "EC1": 5.0,
        "ETC1": 0.01,
        "ETC2": 0.1,
        "CCVS1": 0.1,
        "ET1": 1.0,
        "AMB": 1.0,
        "ClutchActuator": 0.01,
    }
    assert all(message.is_j1939 for message in truck.messages.values())
    assert truck.warnings == ()


@pytest.mark.parametrize("encoding", ["utf-8", "cp1252"])
def test_units_in_either_encoding(encoding, tmp_path):
    path = tmp_path / "a.dbc"
    path.write_bytes(ONE.encode(encoding))
    message = load([path]).message("One")
    assert message.signal("S").unit == "°C"
    assert not message.is_j1939 and not message.extended and message.cycle_time_s is None


def test_j1939_is_known_by_the_protocol_of_the_file(tmp_path):
    path = tmp_path / "a.dbc"
    text = ONE.replace("BO_ 100", f"BO_ {0x98EFF100}")
    defined = 'BA_DEF_ "ProtocolType" STRING ;\nBA_DEF_DEF_ "ProtocolType" "";\n'
    path.write_text(text)
    assert not load([path]).message("One").is_j1939
    path.write_text(text + defined + 'BA_ "ProtocolType" "J1939";\n')
    assert load([path]).message("One").is_j1939
    path.write_text(text.replace(str(0x98EFF100), str(0x98FEF100)) + defined)
    assert not load([path]).message("One").is_j1939


@pytest.mark.parametrize(
    ("ids", "fits"),
    [
        ((0x98FEF1FE, 0x8CF00400, 0x98FF5003), True),
        ((0x98FEF1FE, 100), True),  # an id of 11 bits is no objection
        ((0x98FF5003, 0x98FF5103), False),  # proprietary groups alone say nothing
        ((0x98FEF100, 0x98DA10F1, 0x98DAF110), False),
        ((0x90424060, 0x902CC040), False),
        ((100,), False),
    ],
)
def test_j1939_without_an_attribute_is_known_by_its_ids(ids, fits, tmp_path):
    messages = [f'BO_ {i} M{k}: 2 A\n SG_ S : 0|8@1+ (1,0) [0|0] "" A\n' for k, i in enumerate(ids)]
    (tmp_path / "a.dbc").write_text(HEAD + "".join(messages))
    database = load([tmp_path / "a.dbc"])
    extended = [message for message in database.messages.values() if message.extended]
    assert all(message.is_j1939 == fits for message in extended)
    assert len(database.warnings) == fits
    if fits:
        assert "parameter groups" in database.warnings[0]
        assert database.find(0x18FEF121, True).name == "M0"


def with_bad_parts() -> str:
    return (
        HEAD + "BO_ 1 A: 8 A\n"
        ' SG_ 2x : 0|8@1+ (1,0) [0|0] "" A\n SG_ y : 8|8@1+ (1,0) [0|0] "" A\n'
        'BO_ 2 1B: 8 A\n SG_ y : 8|8@1+ (1,0) [0|0] "" A\n'
        f'BO_ {0x0CF00400} C: 8 A\n SG_ z : 8|8@1- (2,0) [0|0] "" A\n'
        'BO_ 4 D: 8 A\n SG_ z : 8|8@1+ (1,0) [0|0] "" A\n'
        'VAL_ 4 q 0 "a" ;\nVAL_ 9 z 0 "a" ;\n'
        f'VAL_ {0x0CF00400} z 0 "off" ;\nBO_ what 5\nCM_ "never closed\n'
    )


def test_what_is_not_valid_is_named_and_the_rest_used(tmp_path, caplog):
    path = tmp_path / "bad.dbc"
    path.write_text(with_bad_parts())
    database = load([path])
    signals = {name: list(message.signals) for name, message in database.messages.items()}
    assert signals == {"A": ["y"], "C": ["z"], "D": ["z"]}
    assert database.message("C").id == 0x0CF00400 and database.message("C").extended
    assert all(str(path) in warning for warning in database.warnings)
    for part in (
        "line 5: 'SG_ 2x",
        "line 7: 'BO_ 2 1B",
        "line 9: message 'C': id 217056256 has more than 11 bits",
        "line 13: 'VAL_ 4 q",
        "line 14: 'VAL_ 9 z",
        "line 16: 'BO_ what 5'",
        "line 17: 'CM_ \"never closed'",
    ):
        assert sum(part in warning for warning in database.warnings) == 1, part
    assert load([path]) == database  # from the cache
    assert caplog.records == []


BEGIN = 'VERSION ""\n\nBS_:\n\nBU_: ECU\n\n'
TWO = (
    'BO_ 291 One: 8 ECU\n SG_ A : 0|8@1+ (1,0) [0|0] "" ECU\n SG_ B : 8|8@1+ (1,0) [0|0] "" ECU\n\n'
    'BO_ 292 Two: 8 ECU\n SG_ C : 0|8@1+ (1,0) [0|0] "" ECU\n\n'
)
ALL = {"One": {"A", "B"}, "Two": {"C"}}
PARTS = {  # text → signals by message, and the line that is named
    TWO + "FOO_ bar baz;\n": (ALL, "line 14: 'FOO_ bar baz;'"),
    TWO.replace("BO_ 292", "CAT_ 4 x;\nBO_ 292"): (ALL, "line 11: 'CAT_ 4 x;'"),
    TWO + 'BA_ "Foo" BO_ 291 5;\n': (ALL, "line 14: 'BA_ \"Foo\" BO_ 291 5;'"),
    TWO.replace("8|8@1", "8|0@1"): ({"One": {"A"}, "Two": {"C"}}, "line 9: 'SG_ B"),
    TWO[: TWO.rindex("@1+")]: ({"One": {"A", "B"}, "Two": set()}, "line 12: 'SG_ C : 0|8'"),
    TWO[: TWO.rindex("8 ECU")]: ({"One": {"A", "B"}}, "line 11: 'BO_ 292 Two:'"),
    TWO.replace(": 8 ECU", ": 8 "): (ALL, ""),
    TWO.replace('"" ECU', '""'): (ALL, ""),
    TWO.replace('"" ECU', '""').rstrip(): (ALL, ""),
    TWO + 'CM_ BO_ 291 "of two lines\nBO_ 9 None: 8\n SG_ Z : 0|8\nend";\n': (ALL, ""),
}


@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize("text", PARTS)
def test_what_is_cut_or_strange_costs_no_more_than_itself(text, end, tmp_path):
    signals, named = PARTS[text]
    (tmp_path / "a.dbc").write_bytes((BEGIN + text).replace("\n", end).encode())
    database = load([tmp_path / "a.dbc"])
    assert {n: set(m.signals) for n, m in database.messages.items()} == signals
    assert len(database.warnings) == bool(named)
    assert all(named in warning for warning in database.warnings)


def test_messages_of_one_name_or_id_are_named(tmp_path, caplog):
    signal = ' SG_ S : 0|8@1+ (1,0) [0|0] "" A\n'
    (tmp_path / "a.dbc").write_text(
        f"{HEAD}BO_ 256 Motor: 8 A\n{signal}BO_ 257 Motor: 8 A\n{signal}BO_ 256 Two: 8 A\n{signal}"
    )
    database = load([tmp_path / "a.dbc"])
    assert list(database.messages) == ["Motor", "Two"]
    assert any("'Motor' and 'Two' have the same id" in w for w in database.warnings)
    assert any("'Motor' is already known" in w for w in database.warnings)
    assert caplog.records == []


@pytest.mark.parametrize("marked", [True, False])
@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-le", "utf-16-be"])
def test_byte_order_marks(encoding, marked, tmp_path):
    mark = "\ufeff" if marked and encoding.endswith(("le", "be")) else ""
    (tmp_path / "a.dbc").write_bytes((mark + ONE).encode(encoding))
    database = load([tmp_path / "a.dbc"])
    assert database.message("One").signal("S").unit == "°C" and database.warnings == ()


def test_unknown_names_come_with_the_nearest(truck):
    with pytest.raises(ClutchestError, match=r"no message 'EEC' in hdt_clutch\.dbc.*'EEC"):
        truck.message("EEC")
    with pytest.raises(ClutchestError, match=r"'ETC1' has no signal 'InputSpeed'.*InputShaft"):
        truck.message("ETC1").signal("InputSpeed")


def test_a_broken_dbc_names_file_and_line(tmp_path):
    path = tmp_path / "broken.dbc"
    path.write_text("no DBC\n" + ONE)
    with pytest.raises(ClutchestError, match=r"broken\.dbc, line 1.*'no DBC'") as caught:
        load([path])
    assert "\n" not in str(caught.value)
    path.write_text(HEAD + "BO_ what 5\n")
    with pytest.raises(ClutchestError, match=r"no messages.*line 4: 'BO_ what 5'"):
        load([path])
    path.write_text(HEAD)
    with pytest.raises(ClutchestError, match="no messages"):
        load([path])
    path.write_bytes(bytes(range(256)))
    with pytest.raises(ClutchestError, match=r"broken\.dbc"):
        load([path])
    with pytest.raises(ClutchestError, match=r"no such file: .*nowhere\.dbc"):
        load([tmp_path / "nowhere.dbc"])


def test_a_shipped_database_is_found_by_its_name(tmp_path, monkeypatch):
    file = locate("hdt_clutch", "dbc")
    for name in (
        "hdt_clutch",
        "hdt_clutch.dbc",
        Path("hdt_clutch"),
        DatabaseFile(Path("hdt_clutch")),
    ):
        assert load([name]) == load([file])
    frames = read_frames(locate("demo", "logs"))
    assert set(frames.decode("hdt_clutch")) == set(frames.decode(file)) != set()
    assert set(frames.decode({0: "hdt_clutch"})) == set(frames.decode({0: file}))
    with pytest.raises(ClutchestError, match="no such file: hdt_cluch; did you mean 'hdt_clutch'"):
        load(["hdt_cluch"])
    monkeypatch.chdir(tmp_path)
    Path("hdt_clutch").write_text(ONE)  # a file of one's own comes first
    assert set(load(["hdt_clutch"]).messages) == {"One"}


def test_overlapping_signals_and_double_names_are_warnings(tmp_path):
    one, two = tmp_path / "one.dbc", tmp_path / "two.dbc"
    one.write_text(ONE + ' SG_ T : 4|8@1+ (1,0) [0|0] "" A\n')
    two.write_text(ONE + 'BO_ 101 Two: 2 A\n SG_ S : 0|8@1+ (1,0) [0|0] "" A\n')
    database = load([one, two])
    assert set(database.messages) == {"One", "Two"}
    assert "T" in database.message("One").signals
    overlap, double = database.warnings
    assert "one.dbc" in overlap and "overlapping" in overlap
    assert "two.dbc" in double and "'One'" in double


def test_a_frame_finds_its_message(truck):
    assert truck.find(0x18FEF121, True).name == "CCVS1"
    assert truck.find(0x18FEF221, True) is None
    assert truck.find(0x7FF, False) is None


def test_real_dbcs_that_are_not_clean(real):
    (warning,) = load([real("vw_pq.dbc")]).warnings
    assert "overlapping" in warning
    hyundai = load([real("hyundai_can.dbc")])
    assert len(hyundai.messages) == 146
    assert ["line 1656" in hyundai.warnings[0], "line 1657" in hyundai.warnings[1]] == [True] * 2


@pytest.mark.parametrize(
    "name", ["hdt_clutch.dbc", "alsd.dbc", "ford_lincoln_base_pt.dbc", "vw_pq.dbc"]
)
def test_a_layout_that_was_read_before_is_the_same(name, real, tmp_path, monkeypatch):
    monkeypatch.setenv("CLUTCHEST_CACHE", str(tmp_path))
    path = shipped("dbc").get(name.removesuffix(".dbc")) or real(name)
    first = load([path])
    (kept,) = tmp_path.glob("dbc_*.json")
    monkeypatch.setitem(sys.modules, "cantools", None)  # may not be asked again
    monkeypatch.setitem(sys.modules, "cantools.database", None)
    again = load([path])
    assert again == first
    assert repr(again) == repr(first)  # 1 and 1.0 are equal, but not the same
    assert (name != "vw_pq.dbc") == (again.warnings == ())
    monkeypatch.undo()
    monkeypatch.setenv("CLUTCHEST_CACHE", str(tmp_path))
    kept.write_text(kept.read_text()[:-40])
    assert load([path]) == first


def test_a_dbc_is_read_where_nothing_can_be_kept(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("CLUTCHEST_CACHE", str(tmp_path / "file" / "below"))
    assert "EEC1" in load([shipped("dbc")["hdt_clutch"]]).messages


def _as(kind: str, text: str) -> str:
    """The messages of a DBC, written as another kind of database by cantools, or by hand."""
    import cantools

    if kind == "arxml":
        return _ARXML
    database = cantools.database.load_string(text, "dbc")
    return database.as_kcd_string() if kind == "kcd" else database.as_sym_string()


_PLAIN = """VERSION ""
NS_ :
BS_:
BU_: A B
BO_ 291 Motor: 8 A
 SG_ Speed : 0|16@1+ (0.25,0) [0|16000] "rpm" B
 SG_ Torque : 16|12@1- (0.5,-10) [-1000|1000] "Nm" B
BO_ 2566844926 Road: 8 A
 SG_ Pace : 8|16@1+ (0.00390625,0) [0|250] "km/h" B
"""

_ARXML = """<?xml version="1.0" encoding="UTF-8"?>
<AUTOSAR xmlns="http://autosar.org/schema/r4.0"><AR-PACKAGES><AR-PACKAGE>
<SHORT-NAME>P</SHORT-NAME><ELEMENTS>
<CAN-CLUSTER><SHORT-NAME>Cluster</SHORT-NAME><CAN-CLUSTER-VARIANTS><CAN-CLUSTER-CONDITIONAL>
<BAUDRATE>500000</BAUDRATE><PHYSICAL-CHANNELS><CAN-PHYSICAL-CHANNEL><SHORT-NAME>Ch</SHORT-NAME>
<FRAME-TRIGGERINGS><CAN-FRAME-TRIGGERING><SHORT-NAME>T</SHORT-NAME>
<FRAME-REF DEST="CAN-FRAME">/P/Motor</FRAME-REF>
<CAN-ADDRESSING-MODE>STANDARD</CAN-ADDRESSING-MODE><IDENTIFIER>291</IDENTIFIER>
</CAN-FRAME-TRIGGERING></FRAME-TRIGGERINGS></CAN-PHYSICAL-CHANNEL></PHYSICAL-CHANNELS>
</CAN-CLUSTER-CONDITIONAL></CAN-CLUSTER-VARIANTS></CAN-CLUSTER>
<CAN-FRAME><SHORT-NAME>Motor</SHORT-NAME><FRAME-LENGTH>8</FRAME-LENGTH><PDU-TO-FRAME-MAPPINGS>
<PDU-TO-FRAME-MAPPING><SHORT-NAME>M</SHORT-NAME>
<PACKING-BYTE-ORDER>MOST-SIGNIFICANT-BYTE-LAST</PACKING-BYTE-ORDER>
<PDU-REF DEST="I-SIGNAL-I-PDU">/P/Pdu</PDU-REF><START-POSITION>0</START-POSITION>
</PDU-TO-FRAME-MAPPING></PDU-TO-FRAME-MAPPINGS></CAN-FRAME>
<I-SIGNAL-I-PDU><SHORT-NAME>Pdu</SHORT-NAME><LENGTH>8</LENGTH><I-SIGNAL-TO-PDU-MAPPINGS>
<I-SIGNAL-TO-I-PDU-MAPPING><SHORT-NAME>S</SHORT-NAME>
<I-SIGNAL-REF DEST="I-SIGNAL">/P/Speed</I-SIGNAL-REF>
<PACKING-BYTE-ORDER>MOST-SIGNIFICANT-BYTE-LAST</PACKING-BYTE-ORDER>
<START-POSITION>0</START-POSITION></I-SIGNAL-TO-I-PDU-MAPPING></I-SIGNAL-TO-PDU-MAPPINGS>
</I-SIGNAL-I-PDU>
<I-SIGNAL><SHORT-NAME>Speed</SHORT-NAME><LENGTH>16</LENGTH>
<SYSTEM-SIGNAL-REF DEST="SYSTEM-SIGNAL">/P/SysSpeed</SYSTEM-SIGNAL-REF></I-SIGNAL>
<SYSTEM-SIGNAL><SHORT-NAME>SysSpeed</SHORT-NAME></SYSTEM-SIGNAL>
</ELEMENTS></AR-PACKAGE></AR-PACKAGES></AUTOSAR>
"""


@pytest.mark.parametrize("kind", ["kcd", "sym", "arxml"])
def test_databases_of_other_kinds(kind, tmp_path):
    (tmp_path / "a.dbc").write_text(_PLAIN)
    (tmp_path / f"a.{kind}").write_text(_as(kind, _PLAIN))
    expected, given = load([tmp_path / "a.dbc"]), load([tmp_path / f"a.{kind}"])
    names = ["Motor"] if kind == "arxml" else ["Motor", "Road"]
    assert list(given.messages) == names
    again = load([tmp_path / f"a.{kind}"])  # from the cache
    for name in names:
        assert again.message(name) == given.message(name)
        a, b = expected.message(name), given.message(name)
        assert (a.id, a.extended, a.length) == (b.id, b.extended, b.length)
        for signal, layout in b.signals.items():
            wanted = a.signal(signal)
            place = ("start", "width", "little_endian", "signed")
            assert [getattr(layout, key) for key in place] == [
                getattr(wanted, key) for key in place
            ]
            if kind != "arxml":
                assert (layout.scale, layout.offset, layout.unit) == (
                    wanted.scale,
                    wanted.offset,
                    wanted.unit,
                )


def test_xml_is_known_by_its_first_element_whatever_its_prefix(tmp_path):
    prefixed = _ARXML.replace("<", "<AR:").replace("<AR:/", "</AR:").replace("<AR:?", "<?")
    prefixed = prefixed.replace("xmlns=", "xmlns:AR=").replace("?>", f"?><!-- {'word ' * 2000}-->")
    (tmp_path / "a.arxml").write_text(prefixed)
    assert list(load([tmp_path / "a.arxml"]).messages) == ["Motor"]
    (tmp_path / "a.xml").write_text('<?xml version="1.0"?>\n<fx:FIBEX xmlns:fx="x"/>')
    with pytest.raises(ClutchestError, match=r"a\.xml: <FIBEX> is no database; expected"):
        load([tmp_path / "a.xml"])


@pytest.mark.parametrize(
    "text", ["<AUTOSAR><broken", "<NetworkDefinition", 'FormatVersion=6.0 // nothing\nTitle="x"\n']
)
def test_a_broken_database_of_another_kind_is_refused_in_a_line(text, tmp_path, capfd):
    (tmp_path / "a.xml").write_text(text)
    with pytest.raises(ClutchestError, match=r"a\.xml: (not a readable|no messages)") as problem:
        load([tmp_path / "a.xml"])
    assert "\n" not in str(problem.value)
    assert capfd.readouterr().err == ""
