from __future__ import annotations

import sys

import pytest

from clutchest.can.database import load
from clutchest.errors import ClutchestError
from clutchest.shipped import shipped

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


def test_shipped_cycle_times(truck):
    assert {name: message.cycle_time_s for name, message in truck.messages.items()} == {
        "EEC1": 0.01,
        "EEC3": 0.25,
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
    text = ONE.replace("BO_ 100", f"BO_ {0x98FEF100}")
    path.write_text(text)
    assert not load([path]).message("One").is_j1939
    path.write_text(
        text + 'BA_DEF_ "ProtocolType" STRING ;\nBA_DEF_DEF_ "ProtocolType" "";\n'
        'BA_ "ProtocolType" "J1939";\n'
    )
    assert load([path]).message("One").is_j1939


def test_unknown_names_come_with_the_nearest(truck):
    with pytest.raises(ClutchestError, match=r"no message 'EC1' in hdt_clutch\.dbc.*'EEC1'"):
        truck.message("EC1")
    with pytest.raises(ClutchestError, match=r"'ETC1' has no signal 'InputSpeed'.*InputShaft"):
        truck.message("ETC1").signal("InputSpeed")


def test_a_broken_dbc_names_file_and_line(tmp_path):
    path = tmp_path / "broken.dbc"
    path.write_text(ONE + "BO_ what 5\n")
    with pytest.raises(ClutchestError, match=r"broken\.dbc, line 6.*'BO_ what 5'") as caught:
        load([path])
    assert "\n" not in str(caught.value)
    path.write_text(ONE + 'CM_ "never closed\n')
    with pytest.raises(ClutchestError, match=r"broken\.dbc, line 6"):
        load([path])
    path.write_text(HEAD)
    with pytest.raises(ClutchestError, match="no messages"):
        load([path])
    path.write_bytes(bytes(range(256)))
    with pytest.raises(ClutchestError, match=r"broken\.dbc"):
        load([path])
    with pytest.raises(ClutchestError, match=r"nowhere\.dbc: cannot be read"):
        load([tmp_path / "nowhere.dbc"])


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
    with pytest.raises(ClutchestError, match=r"hyundai_can\.dbc, line 1656"):
        load([real("hyundai_can.dbc")])


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
