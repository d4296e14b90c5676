"""``clutchest.can``: frames and their signals as tables, for programs of others."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pyarrow as pa
import pytest

import clutchest.can
from clutchest import can
from clutchest.can.encode import encode
from clutchest.errors import ClutchestError
from clutchest.shipped import shipped


@pytest.fixture
def frames():
    """Ten of EEC1 at 100 Hz, three of ETC2, one of them not valid."""
    bus = can.load_database([shipped("dbc")["hdt_clutch"]])
    t_ns = 1_700_000_000_000_000_000 + 10_000_000 * np.arange(10)
    speed = {"EngineSpeed": np.linspace(600.0, 690.0, 10)}
    engine = encode(bus.message("EEC1"), speed, t_ns)
    gear = encode(bus.message("ETC2"), {"CurrentGear": np.array([1.0, 2.0, 3.0])}, t_ns[:3])
    gear.data[1, 3] = 0xFF
    return can.Frames.concatenate([engine, gear]).sorted()


def test_every_message_is_a_table(frames):
    signals = frames.decode(shipped("dbc")["hdt_clutch"])
    assert set(signals) == {"EEC1", "ETC2"} and len(signals) == 2
    table = signals["EEC1"]
    np.testing.assert_allclose(table["EngineSpeed"].to_numpy(), np.linspace(600, 690, 10))
    assert table["time"].type == pa.timestamp("ns", "UTC")
    assert (
        table["time"].cast(pa.int64()).to_pylist()
        == frames.t_ns[frames.id >> 8 == 0xCF004].tolist()
    )
    assert table.schema.field("EngineSpeed").metadata == {b"unit": b"rpm"}
    assert signals["ETC2"]["CurrentGear"].to_pylist() == [1.0, None, 3.0]
    with pytest.raises(KeyError, match="no frame of a message 'EEC3'; did you mean 'EEC1'"):
        signals["EEC3"]


def test_frames_show_themselves_in_a_line_and_can_be_compared(frames):
    assert repr(frames) == "<Frames: 13 of 2 ids>"
    assert repr(frames.decode("hdt_clutch")) == "<DecodedFrames: EEC1, ETC2>"
    assert frames == frames.take(slice(None)) != frames.take(slice(12))


def test_what_is_wrong_in_a_call_is_named(frames, tmp_path):
    for call, said in (
        (lambda: can.read_frames(frames), "path: expected a path, not Frames"),
        (lambda: can.read_blocks(3), "path: expected a path, not 3"),
        (lambda: can.write_frames(tmp_path / "a.log", frames), "frames: expected Frames, not"),
        (lambda: frames.decode("hdt_clutch", "EEC1"), "messages: expected a list or None, not"),
    ):
        with pytest.raises(ClutchestError, match=said):
            call()


def test_the_table_of_a_message_has_its_units_as_a_log_too(frames):
    table = frames.decode("hdt_clutch")["EEC1"]
    speed = clutchest.read_log(table, "truck")["engine_speed"].value
    np.testing.assert_allclose(speed, np.linspace(600, 690, 10) * np.pi / 30)


def test_all_readings_in_one_table(frames):
    signals = frames.decode(str(shipped("dbc")["hdt_clutch"]), ["ETC2"])
    table = signals.to_pandas()
    gears = table[table["signal"] == "CurrentGear"]
    assert gears["value"].tolist() == [1.0, 3.0] and set(gears["message"]) == {"ETC2"}
    assert list(table.columns) == ["time", "channel", "message", "signal", "value", "unit"]
    both = frames.decode([shipped("dbc")["hdt_clutch"]]).to_arrow()
    assert set(both["message"].to_pylist()) == {"EEC1", "ETC2"}
    assert (
        len(can.Frames.empty().decode(can.load_database([shipped("dbc")["hdt_clutch"]])).to_arrow())
        == 0
    )
    with pytest.raises(ClutchestError, match="no message 'EEC9'; did you mean 'EEC"):
        frames.decode(shipped("dbc")["hdt_clutch"], ["EEC9"])


def test_what_is_written_is_read_and_decoded_in_blocks(frames, tmp_path):
    assert can.write_frames(frames, tmp_path / "a.log") == ()
    parts = [
        block.decode(shipped("dbc")["hdt_clutch"]) for block in can.read_blocks(tmp_path / "a.log")
    ]
    assert sum(len(part["EEC1"]) for part in parts if "EEC1" in part) == 10


def test_the_room_itself_loads_nothing_heavy():
    heavy = ("numba", "casadi", "pandas", "pyarrow", "cantools", "asammdf")
    program = f"import sys, clutchest.can; print([m for m in {heavy!r} if m in sys.modules])"
    made = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert made.stdout.strip() == "[]"
    program = program.replace("clutchest.can;", "clutchest.can; clutchest.can.Frames;")
    made = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert made.stdout.strip() == "[]"
    assert set(clutchest.can.__all__) <= set(dir(clutchest.can))
