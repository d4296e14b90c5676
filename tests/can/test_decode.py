from __future__ import annotations

from pathlib import Path

import cantools
import numpy as np
import pytest

from clutchest.can.database import Message, load
from clutchest.can.decode import decode, rows_of
from clutchest.can.encode import encode
from clutchest.can.frames import Flag, Frames
from clutchest.errors import ClutchestError
from clutchest.shipped import locate
from clutchest.signals import Why
from samples import EVERYTHING, random_frames


@pytest.fixture(scope="module")
def everything(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("dbc") / "everything.dbc"
    path.write_text(EVERYTHING)
    return path


def payloads(message: Message, n: int, seed: int) -> Frames:
    """Random frames of one message, all zeros and all ones among them."""
    rng = np.random.default_rng(seed)
    frames = Frames.empty(n, max(8, message.length))
    frames.id[:] = message.id
    frames.flags[:] = Flag.EXTENDED if message.extended else 0
    frames.length[:] = message.length
    frames.data[:, : message.length] = rng.integers(0, 256, (n, message.length))
    frames.data[0] = 0
    frames.data[1, : message.length] = 255
    return frames


def overlapping(message) -> bool:
    """Whether cantools itself cannot place the signals of this message."""
    try:
        message.refresh(strict=True)
    except cantools.database.Error:
        return True
    return False


def assert_like_cantools(path: Path, n: int) -> int:
    """Every signal of every message, bit for bit; the number of values compared."""
    database = load([path])
    reference = cantools.database.load_file(str(path), strict=False, encoding="utf-8")
    compared = 0
    for message in reference.messages:
        if overlapping(message):
            continue
        ours = database.message(message.name)
        frames = payloads(ours, n, seed=message.frame_id)
        rows = rows_of(frames, ours)
        assert len(rows) == n
        columns = decode(frames, rows, ours, list(ours.signals))
        expected: dict[str, dict[int, float]] = {name: {} for name in ours.signals}
        for row, data in enumerate(frames.data[:, : ours.length]):
            try:
                values = message.decode(data.tobytes(), decode_choices=False, scaling=True)
            except cantools.database.DecodeError:  # a multiplexer value without signals
                values = decoded_by_hand(message, data.tobytes())
            for name, value in values.items():
                expected[name][row] = float(value)
        for name, column in columns.items():
            switch = ours.signals[name].multiplexer
            if switch and not message.get_signal_by_name(switch).is_multiplexer:
                continue  # vw_pq writes 'm' for 'M' once; cantools then never reaches the signal
            assert column.rows.tolist() == list(expected[name]), (message.name, name)
            wanted = np.array(list(expected[name].values()))
            # What the bus declares not to be a value is not compared here.
            by_code = np.isin(column.why, [Why.NOT_AVAILABLE, Why.ERROR, Why.RESERVED])
            assert not by_code.any() or ours.is_j1939
            wanted[np.isinf(wanted)] = np.nan
            np.testing.assert_array_equal(column.value[~by_code], wanted[~by_code], err_msg=name)
            assert np.isnan(column.value[by_code]).all()
            compared += np.count_nonzero(~by_code)
    return compared


def decoded_by_hand(message, data: bytes) -> dict[str, float]:
    """The signals that are there whatever an unlisted multiplexer value means."""
    always = cantools.database.can.Message(
        message.frame_id,
        message.name,
        message.length,
        [s for s in message.signals if s.multiplexer_ids is None],
        strict=False,
    )
    for signal in always.signals:
        signal.is_multiplexer = False
    always.refresh()
    return always.decode(data, decode_choices=False)


def test_every_kind_of_layout_is_like_cantools(everything):
    assert assert_like_cantools(everything, 200) > 2000


def test_the_shipped_dbc_is_like_cantools():
    assert assert_like_cantools(locate("hdt_clutch", "dbc"), 200) > 5000


@pytest.mark.parametrize(
    "name",
    [
        "ford_lincoln_base_pt.dbc",
        "hyundai_2015_ccan.dbc",
        "vw_pq.dbc",
        "CSS-Electronics-SAE-J1939-DEMO.dbc",
    ],
)
def test_real_dbcs_are_like_cantools(name, real):
    assert assert_like_cantools(real(name), 24) > (80 if "CSS" in name else 5000) * 24 // 100


def test_extended_multiplexing_by_hand(everything):
    message = load([everything]).message("Switched")
    frames = payloads(message, 5, seed=0)
    frames.data[:] = 0
    frames.data[:, 0] = [0, 1, 1, 4, 7]
    frames.data[:, 1] = [9, 3, 101, 8, 0]
    frames.data[:, 2] = [1, 2, 3, 4, 5]
    columns = decode(frames, np.arange(5), message, ["A", "B", "C", "D", "E"])
    assert {name: column.rows.tolist() for name, column in columns.items()} == {
        "A": [0, 3],
        "B": [1, 2],
        "C": [1],
        "D": [4],
        "E": [0, 1, 2, 3, 4],
    }
    assert columns["C"].value.tolist() == [1.0]


def test_short_and_long_frames(truck):
    message = truck.message("EEC1")
    frames = payloads(message, 4, seed=3)
    frames.data[:, 3:5] = (0x40, 0x1F)  # 1000 rpm
    frames.length[:] = [8, 5, 4, 3]
    frames.data[np.arange(8) >= frames.length[:, None]] = 0
    speed = decode(frames, np.arange(4), message, ["EngineSpeed"])["EngineSpeed"]
    assert speed.why.tolist() == [Why.VALID, Why.VALID, Why.TOO_SHORT, Why.TOO_SHORT]
    np.testing.assert_array_equal(speed.value, [1000, 1000, np.nan, np.nan])
    long = Frames.empty(1, 64)
    long.data[0, 3:5], long.length[0] = (0x40, 0x1F), 64
    speed = decode(long, np.arange(1), message, ["EngineSpeed"])["EngineSpeed"]
    assert speed.value.tolist() == [1000]


def test_a_switch_that_is_cut_off_makes_its_signals_too_short(everything):
    message = load([everything]).message("Switched")
    frames = payloads(message, 3, seed=4)
    frames.length[1] = 0
    a = decode(frames, np.arange(3), message, ["A"])["A"]
    assert a.why[a.rows == 1].tolist() == [Why.TOO_SHORT]


def test_rows_are_data_frames_of_that_id_only(everything, truck):
    frames = Frames.empty(7)
    frames.id[:] = 256
    frames.flags[:] = [0, Flag.EXTENDED, Flag.REMOTE, Flag.ERROR, Flag.FD, Flag.SENT, 0]
    frames.channel[6] = 1
    floats = load([everything]).message("Floats")
    assert rows_of(frames, floats).tolist() == [0, 4, 5, 6]
    assert rows_of(frames, floats, channel=1).tolist() == [6]


def test_j1939_messages_are_known_by_their_group(truck):
    ids = [0x0CF00400, 0x18F00421, 0x0CF00300, 0x0CF104FE, 0x0CF00400, 0x0DF00400]
    frames = Frames.empty(len(ids))
    frames.id[:], frames.length[:] = ids, 8
    frames.flags[:] = Flag.EXTENDED
    frames.flags[4] = 0
    assert rows_of(frames, truck.message("EEC1")).tolist() == [0, 1]


def test_not_available_error_and_reserved(truck):
    message = truck.message("EEC1")
    frames = payloads(message, 5, seed=5)
    frames.data[:, 3:5] = [(0xFF, 0xFF), (0x00, 0xFF), (0x12, 0xFE), (0x00, 0xFB), (0xFF, 0xFA)]
    frames.data[:, 2] = [0xFF, 0xFE, 0xFD, 0xFB, 0xFA]
    frames.data[:, 0] = [0x70, 0x80, 0xFF, 0x0E, 0x0F]
    columns = decode(
        frames,
        np.arange(5),
        message,
        [
            "EngineSpeed",
            "ActualEnginePercentTorque",
            "EngineTorqueMode",
            "ActualEnginePercentTorqueFractional",
        ],
    )
    na, error, reserved, ok = Why.NOT_AVAILABLE, Why.ERROR, Why.RESERVED, Why.VALID
    assert columns["EngineSpeed"].why.tolist() == [na, na, error, reserved, ok]
    assert columns["EngineSpeed"].value[4] == 8031.875
    assert columns["ActualEnginePercentTorque"].why.tolist() == [na, error, reserved, reserved, ok]
    assert columns["EngineTorqueMode"].why.tolist() == [ok, ok, na, ok, na]
    fraction = columns["ActualEnginePercentTorqueFractional"]
    assert fraction.why.tolist() == [ok, na, na, ok, ok]
    np.testing.assert_array_equal(fraction.value, [0.875, np.nan, np.nan, 0, 0])


def test_counters_and_checksums_have_no_codes(truck):
    message = truck.message("ClutchActuator")
    frames = payloads(message, 2, seed=6)
    columns = decode(frames, np.arange(2), message, ["ActuatorCounter", "ActuatorChecksum"])
    assert columns["ActuatorCounter"].value.tolist() == [0, 15]
    assert columns["ActuatorChecksum"].value.tolist() == [0, 255]


def test_unknown_signal_and_one_that_is_too_wide(truck, tmp_path):
    with pytest.raises(ClutchestError, match=r"'EEC1' has no signal 'EngineSped'.*'EngineSpeed'"):
        decode(Frames.empty(1), np.arange(1), truck.message("EEC1"), ["EngineSped"])
    path = tmp_path / "wide.dbc"
    path.write_text('VERSION ""\nBS_:\nBU_: A\nBO_ 1 M: 16 A\n SG_ S : 0|72@1+ (1,0) [0|0] "" A\n')
    with pytest.raises(ClutchestError, match="'S' of message 'M' has 72 bits"):
        decode(Frames.empty(1), np.arange(1), load([path]).message("M"), ["S"])


BRANCHES = """VERSION ""
BS_:
BU_: A
BO_ 7 Debug: 8 A
 SG_ Mux M : 0|4@1+ (1,0) [0|0] "" A
 SG_ Stamp m0 : 24|8@1+ (1,0) [0|0] "" A
 SG_ Speed m0 : 8|16@1+ (0.25,0) [0|0] "rpm" A
 SG_ Stamp m1 : 24|8@1+ (1,0) [0|0] "" A
 SG_ Torque m1 : 8|16@1- (0.5,0) [0|0] "Nm" A
 SG_ Stamp m2 : 39|12@0- (0.5,3) [0|0] "" A
 SG_ Stamp m5 : 39|12@0- (0.5,3) [0|0] "" A
 SG_ Torque m5 : 8|8@1+ (1,0) [0|0] "Nm" A
"""


def test_one_name_in_several_branches_of_a_multiplexer(tmp_path, monkeypatch):
    monkeypatch.setenv("CLUTCHEST_CACHE", str(tmp_path))
    (tmp_path / "a.dbc").write_text(BRANCHES)
    database = load([tmp_path / "a.dbc"])
    assert load([tmp_path / "a.dbc"]) == database  # as it was kept
    message = database.message("Debug")
    stamp = message.signal("Stamp")
    assert stamp.multiplexer_ids == {0, 1} and [b.multiplexer_ids for b in stamp.branches] == [
        {2, 5}
    ]
    rng = np.random.default_rng(8)
    frames = random_frames(400, seed=8)
    frames.data[:, 0] = rng.integers(0, 7, 400)
    frames.length[:] = 8
    reference = cantools.database.load_file(str(tmp_path / "a.dbc")).get_message_by_name("Debug")
    rows = np.arange(400)
    columns = decode(frames, rows, message, ["Stamp", "Speed", "Torque"])
    expected = {
        row: reference.decode(frames.data[row].tobytes(), decode_choices=False)
        for row in rows.tolist()
        if frames.data[row, 0] & 0xF in (0, 1, 2, 5)
    }
    for name, column in columns.items():
        carried = [row for row, values in expected.items() if name in values]
        assert column.rows.tolist() == carried
        assert column.value.tolist() == [expected[row][name] for row in carried]


def test_branches_are_encoded_where_they_lie(tmp_path):
    (tmp_path / "a.dbc").write_text(BRANCHES)
    message = load([tmp_path / "a.dbc"]).message("Debug")
    values = {"Mux": np.array([0, 1, 2, 5]), "Stamp": np.array([7.0, 8.0, -900.5, 90.5])}
    frames = encode(message, values, np.arange(4))
    stamp = decode(frames, np.arange(4), message, ["Stamp"])["Stamp"]
    assert stamp.rows.tolist() == [0, 1, 2, 3] and stamp.value.tolist() == [7.0, 8.0, -900.5, 90.5]
