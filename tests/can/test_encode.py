from __future__ import annotations

import cantools
import numpy as np
import pytest

from clutchest.can.database import load
from clutchest.can.decode import decode, rows_of
from clutchest.can.encode import check, encode, rewritten
from clutchest.can.frames import Flag, Frames
from clutchest.errors import ClutchestError
from clutchest.shipped import locate
from clutchest.signals import Why
from samples import EVERYTHING

T = np.arange(50) * 10**7


def own(name: str) -> bool:
    return name.endswith(("Counter", "Checksum"))


def test_what_is_encoded_is_decoded(truck):
    """Any value on the grid of the bus comes back as it was."""
    rng = np.random.default_rng(0)
    for message in truck.messages.values():
        values = {}
        for name, layout in message.signals.items():
            raws = rng.integers(0, 2 ** min(layout.width - 1, 7), len(T))
            values[name] = raws * layout.scale + layout.offset
        frames = encode(message, values, T, source_address=0x42, channel=2)
        assert set(frames.id) == {(message.id & ~0xFF) | 0x42}
        long = Flag.FD if message.length > 8 else 0
        assert set(frames.flags) == {Flag.EXTENDED | long} and set(frames.channel) == {2}
        rows = rows_of(frames, message)
        columns = decode(frames, rows, message, list(message.signals))
        for name, column in columns.items():
            np.testing.assert_array_equal(column.value, values[name], err_msg=name)


def test_one_signal_is_rewritten_and_nothing_else(truck):
    rng, rows = np.random.default_rng(0), np.arange(10, 20)
    for message in truck.messages.values():
        values = {
            name: rng.integers(0, 2 ** min(x.width - 1, 7), len(T)) * x.scale + x.offset
            for name, x in message.signals.items()
        }
        frames = encode(message, values, T)
        for name, layout in message.signals.items():
            changed = rewritten(frames, rows, message, name, layout.scale + layout.offset)
            expected = {n: v.copy() for n, v in values.items()}
            expected[name][rows] = layout.scale + layout.offset
            assert np.array_equal(changed.data, encode(message, expected, T).data), name


@pytest.mark.parametrize("source", ["everything", "hdt_clutch"])
def test_payloads_are_those_of_cantools(source, tmp_path):
    path = tmp_path / "everything.dbc"
    path.write_text(EVERYTHING)
    path = locate("hdt_clutch", "dbc") if source == "hdt_clutch" else path
    database, reference = load([path]), cantools.database.load_file(str(path))
    rng = np.random.default_rng(1)
    for message in reference.messages:
        if message.is_multiplexed():
            continue
        values = {}
        for signal in message.signals:
            top = max(1 - signal.is_signed, 2 ** min(signal.length - 1, 20) - 1)  # codes lie above
            raws = rng.uniform(0, top, len(T))
            values[signal.name] = raws * float(signal.scale) + float(signal.offset)
            if signal.maximum and signal.maximum > (signal.minimum or 0):
                values[signal.name] = np.clip(values[signal.name], signal.minimum, signal.maximum)
        ours = encode(database.message(message.name), values, T)
        for i in range(len(T)):
            row = {name: float(column[i]) for name, column in values.items()}
            theirs = message.encode(row, padding=database.message(message.name).is_j1939)
            assert ours.data[i, : message.length].tobytes() == theirs, (message.name, row)


def test_multiplexed_signals_are_written_where_they_are_switched_on(tmp_path):
    (tmp_path / "a.dbc").write_text(EVERYTHING)
    message = load([tmp_path / "a.dbc"]).message("Switched")
    values = {
        "M": np.array([0, 1, 5, 7]),
        "A": np.array([11, np.nan, 13, np.nan]),
        "D": np.array([0, 0, 0, 500.0]),
        "E": 9,
    }
    frames = encode(message, values, np.arange(4))
    columns = decode(frames, np.arange(4), message, list(values))
    assert columns["A"].rows.tolist() == [0, 2] and columns["A"].value.tolist() == [11, 13]
    assert columns["D"].rows.tolist() == [3] and columns["D"].value.tolist() == [500]
    assert columns["E"].value.tolist() == [9] * 4
    with pytest.raises(ClutchestError, match=r"'A' .* needs its multiplexer 'M'"):
        encode(message, {"A": np.zeros(4)}, np.arange(4))


def test_values_saturate_and_never_turn_into_codes(truck):
    message = truck.message("EEC1")
    wild = np.array([-1e9, -0.1, 0.0, 8031.9, 1e9, np.inf, -np.inf])
    names = ["EngineSpeed", "ActualEnginePercentTorque", "ActualEnginePercentTorqueFractional"]
    frames = encode(message, dict.fromkeys(names, wild), np.arange(7))
    columns = decode(frames, np.arange(7), message, list(message.signals))
    assert columns["EngineSpeed"].value.tolist() == [0, 0, 0] + [8031.875] * 3 + [0]
    torque = columns["ActualEnginePercentTorque"].value.tolist()
    assert torque == [-125, 0, 0, 125, 125, 125, -125]
    fraction = columns["ActualEnginePercentTorqueFractional"].value.tolist()
    assert fraction == [0, 0, 0, 0.875, 0.875, 0.875, 0]


def test_extreme_values_of_wide_signals(tmp_path):
    (tmp_path / "a.dbc").write_text(EVERYTHING)
    database = load([tmp_path / "a.dbc"])
    for name, low, high in [("Wide", 0, 2**64), ("WideSigned", -(2**63), 2**63)]:
        message = database.message(name)
        frames = encode(message, {"Whole": np.array([-1e30, 1e30])}, np.arange(2))
        raw = decode(frames, np.arange(2), message, ["Whole"])["Whole"].raw
        assert raw[0] == low and high * (1 - 1e-12) < int(raw[1]) < high


def test_missing_values_become_not_available(truck, tmp_path):
    message = truck.message("EEC1")
    frames = encode(message, {"EngineSpeed": [1000.0, np.nan]}, [0, 1])
    assert bytes(frames.data[0]) == bytes([255, 255, 255, 0x40, 0x1F, 255, 255, 255])
    assert bytes(frames.data[1]) == b"\xff" * 8
    columns = decode(frames, np.arange(2), message, list(message.signals))
    assert columns["EngineSpeed"].why.tolist() == [Why.VALID, Why.NOT_AVAILABLE]
    others = [column for name, column in columns.items() if name != "EngineSpeed"]
    assert all(set(column.why) == {Why.NOT_AVAILABLE} for column in others)

    (tmp_path / "a.dbc").write_text(EVERYTHING)
    crossing = load([tmp_path / "a.dbc"]).message("Crossing")
    assert not encode(crossing, {}, [0]).data.any()
    with pytest.raises(ClutchestError, match=r"'A' of message 'Crossing' has no code .* value 1 "):
        encode(crossing, {"A": [0.0, np.nan]}, [0, 1])


def actuator(truck, n: int = 40) -> Frames:
    values = {"SlavePosition": np.linspace(38, 50, n), "MotorPosition": np.linspace(0, 12, n)}
    return encode(truck.message("ClutchActuator"), values, np.arange(n) * 10**7, 0x03)


def test_counter_counts_and_checksum_is_right(truck):
    message = truck.message("ClutchActuator")
    frames = actuator(truck)
    counter = decode(frames, np.arange(40), message, ["ActuatorCounter"])["ActuatorCounter"]
    assert counter.value.tolist() == [i % 16 for i in range(40)]
    frame = [*bytes(frames.data[0][:7]), 0x18, 0xFF, 0x10, 0x03]
    assert frames.data[0, 7] == (sum(frame) + (sum(frame) >> 8)) % 256
    result = check(frames, np.arange(40), message)
    assert result.checksum.all() and result.counter.all() and result.jumps == 0


def test_every_flipped_bit_is_seen(truck):
    message = truck.message("ClutchActuator")
    frames = actuator(truck, 64)
    bits = np.arange(64)
    frames.data[bits, bits // 8] ^= (1 << bits % 8).astype(np.uint8)
    assert not check(frames, bits, message).checksum.any()


def test_lost_and_frozen_frames_are_jumps(truck):
    message = truck.message("ClutchActuator")
    frames = actuator(truck)
    kept = np.delete(np.arange(40), [10, 11, 30])
    result = check(frames, kept, message)
    assert result.jumps == 2 and result.checksum.all()
    assert kept[~result.counter].tolist() == [12, 31]
    frozen = np.r_[0:5, 5, 5, 5, 6:10]
    assert check(frames, frozen, message).jumps == 2


def test_two_senders_count_for_themselves(truck):
    message = truck.message("ClutchActuator")
    other = encode(message, {}, np.arange(40) * 10**7 + 5, 0x04)
    both = Frames.concatenate([actuator(truck), other]).sorted()
    assert check(both, rows_of(both, message), message).jumps == 0


def test_a_message_without_counter_is_always_right(truck):
    frames = encode(truck.message("ET1"), {"EngineCoolantTemperature": [80.0, 81.0]}, [0, 10**9])
    result = check(frames, np.arange(2), truck.message("ET1"))
    assert result.checksum.all() and result.jumps == 0


COUNTERS = """VERSION ""
BS_:
BU_: A
BO_ 1 ToFourteen: 8 A
 SG_ ACounter : 4|4@1+ (1,0) [0|14] "" A
BO_ 2 AllBits: 8 A
 SG_ ACounter : 4|4@1+ (1,0) [0|0] "" A
BO_ 3 Signed: 8 A
 SG_ A : 0|12@1- (0.5,10) [0|0] "" A
"""


@pytest.mark.parametrize(("name", "turns"), [("ToFourteen", 15), ("AllBits", 16)])
def test_a_counter_wraps_behind_its_maximum(name, turns, tmp_path):
    (tmp_path / "a.dbc").write_text(COUNTERS)
    message = load([tmp_path / "a.dbc"]).message(name)
    frames = encode(message, {}, T)
    counts = decode(frames, np.arange(50), message, ["ACounter"])["ACounter"].value
    assert counts.tolist() == [i % turns for i in range(50)]
    assert check(frames, np.arange(50), message).jumps == 0
    one_lost = np.delete(np.arange(50), turns)  # the frame with a zero
    assert check(frames, one_lost, message).jumps == 1


def test_a_signed_value_saturates_at_both_ends(tmp_path):
    (tmp_path / "a.dbc").write_text(COUNTERS)
    message = load([tmp_path / "a.dbc"]).message("Signed")
    frames = encode(message, {"A": [-2000.0, -1014.0, 9.5, 1033.5, 1034.0, 2000.0]}, np.arange(6))
    column = decode(frames, np.arange(6), message, ["A"])["A"]
    assert column.raw.tolist() == [-2048, -2048, -1, 2047, 2047, 2047]
    assert column.value.tolist() == [-1014.0, -1014.0, 9.5, 1033.5, 1033.5, 1033.5]
