"""What somebody gets wrong who writes a vehicle file and a DBC of his own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from clutchest import replay
from clutchest.can.database import DatabaseFile, load
from clutchest.can.frames import Flag, Frames
from clutchest.errors import ClutchestError
from clutchest.reading import load_database, read_log
from clutchest.reading.conversion import Conversion
from clutchest.reading.inspection import inspect_logs
from clutchest.reading.mapping import signals_of
from clutchest.reading.wanted import mapped_messages
from clutchest.shipped import shipped
from clutchest.vehicle import load_vehicle

Edit = Callable[..., Path]

OWN = """VERSION ""

BO_ 256 MOTOR_1: 8 MSG
 SG_ nIst : 0|16@1+ (0.25,0) [0|0] "rpm" Vector__XXX

BO_ 272 GETR_1: 8 EGS
 SG_ MUX M : 0|4@1+ (1,0) [0|0] "" Vector__XXX
 SG_ nEin m0 : 16|16@1+ (0.25,0) [0|0] "rpm" Vector__XXX
"""
ENGINE = 'message = "EEC1"\nsignal = "EngineSpeed"\n'
CLUTCH = """message = "ETC1"
signal = "InputShaftSpeed"
"""


def refusal(path: Path) -> str:
    vehicle = load_vehicle(path)
    with pytest.raises(ClutchestError) as refused:
        mapped_messages(vehicle, load_database(vehicle))
    return str(refused.value)


def own(edited: Edit, tmp_path: Path, *changes: tuple[str, str], dbc: str = OWN) -> Path:
    """The truck with speeds of a DBC of one's own beside the shipped one."""
    (tmp_path / "own.dbc").write_text(dbc, encoding="utf-8")
    return edited(
        ('"hdt_clutch.dbc"', '"hdt_clutch.dbc", "own.dbc"'),
        (CLUTCH, 'message = "GETR_1"\nsignal = "nEin"\n'),
        *changes,
    )


def test_what_the_dbc_contradicts_is_named_with_its_line(edited) -> None:
    assert refusal(edited(('signal = "EngineSpeed"', 'signal = "EngineSped"'))).startswith(
        "mine.toml:12: signals.engine_speed: message 'EEC1' has no signal 'EngineSped'; did"
    )
    assert refusal(edited(('message = "EEC3"', 'message = "EEC33"'))).startswith(
        "mine.toml:22: signals.engine_torque: no message 'EEC33'"
    )


def test_a_signal_of_another_message_says_which(edited) -> None:
    words = refusal(edited((CLUTCH, CLUTCH.replace("ETC1", "EEC1"))))
    assert words.endswith("; ETC1 has it")


def test_a_signal_that_the_dbc_lost_is_named_with_the_dbc_line(edited, tmp_path) -> None:
    comma = OWN.replace("(0.25,0) [0|0]", "(0,25,0) [0|0]")
    words = refusal(own(edited, tmp_path, dbc=comma))
    assert "own.dbc: line 8: 'SG_ nEin m0 : 16|16@1+ (0,25,0)" in words
    assert "left out: not valid in a DBC" in words


def test_one_signal_is_not_two(edited) -> None:
    """Engine and shaft from one signal would be a clutch that never slips."""
    same = 'message = "EEC1"\nsignal = "EngineSpeed"\n'
    words = refusal(edited((CLUTCH, same)))
    assert words.endswith("input_shaft_speed: EEC1.EngineSpeed is signals.engine_speed already")


def test_a_source_address_where_there_is_none(edited, tmp_path) -> None:
    words = refusal(own(edited, tmp_path, ('"nEin"\n', '"nEin"\nsource_address = 3\n')))
    assert words.endswith("source_address = 3, but GETR_1 is not of J1939")


def test_a_checked_message_without_counter_and_checksum(edited, tmp_path) -> None:
    path = own(edited, tmp_path, ('["ClutchActuator"]', '["GETR_1"]'))
    assert ":8: checked: GETR_1 has no signal whose name ends in Counter" in refusal(path)


def test_a_signal_that_is_no_number(edited, tmp_path) -> None:
    words = refusal(
        own(
            edited, tmp_path, dbc=OWN.replace("16|16@1+", "16|65@1+").replace(": 8 EGS", ": 64 EGS")
        )
    )
    assert words.endswith("signals.input_shaft_speed: GETR_1.nEin has 65 bits; a number has 64")


def test_of_two_signals_of_one_name_the_first_holds(tmp_path) -> None:
    """Both together would be readings of two things."""
    twice = OWN.replace(
        "\n\nBO_ 272", '\n SG_ nIst : 32|8@1+ (1,-125) [0|0] "%" Vector__XXX\n\nBO_ 272'
    )
    (tmp_path / "own.dbc").write_text(twice, encoding="utf-8")
    read = load([tmp_path / "own.dbc"])
    assert (
        read.message("MOTOR_1").signal("nIst").start,
        read.message("MOTOR_1").signal("nIst").branches,
    ) == (0, ())
    (words,) = read.warnings
    assert "line 5: 'SG_ nIst : 32|8@1+" in words
    assert words.endswith("left out: its message has a signal of this name already")


def test_a_factor_of_0_is_a_warning(tmp_path) -> None:
    (tmp_path / "own.dbc").write_text(OWN.replace("0.25", "0.0", 1), encoding="utf-8")
    (words,) = load([tmp_path / "own.dbc"]).warnings
    assert words.endswith("line 4: signal 'nIst' has the factor 0: it never changes")


def test_a_delay_in_ms_is_unlikely(edited) -> None:
    late = edited(("noise = 0.01\n", "noise = 0.01\ndelay = 20\n"))
    assert load_vehicle(late).notes == (
        "mine.toml: unlikely: signals.slave_position.delay = 20 s, such sensors have at most 1",
    )


def frames(channel: int = 0) -> Frames:
    """Both messages of ``OWN`` at 100 Hz; the second only in branch 1."""
    n = 20
    data = np.zeros((n, 8), np.uint8)
    data[:, 1] = 9
    data[1::2, 0] = 1
    ids = np.where(np.arange(n) % 2, 272, 256).astype(np.uint32)
    t_ns = 1_700_000_000_000_000_000 + np.arange(n) * 5_000_000
    bytes_of = np.full(n, 8, np.uint8)
    none = np.zeros(n, np.uint8)
    return Frames(t_ns, np.full(n, channel, np.uint8), ids, none, bytes_of, data)


def test_a_branch_that_is_never_sent_is_a_warning(edited, tmp_path) -> None:
    vehicle = load_vehicle(own(edited, tmp_path))
    signals = signals_of(frames(), vehicle, load_database(vehicle))
    assert "input_shaft_speed: no frame has GETR_1.nEin (multiplexed otherwise)" in signals.warnings


def test_the_channel_that_has_the_message_is_named(edited, tmp_path) -> None:
    vehicle = load_vehicle(own(edited, tmp_path, ('"nEin"\n', '"nEin"\nchannel = 0\n')))
    dbc = load([tmp_path / "own.dbc"])
    sent = OWN.replace(" M :", " :").replace(" m0 :", " :")
    (tmp_path / "own.dbc").write_text(sent, encoding="utf-8")
    plain = load_database(vehicle)
    assert any(
        w.endswith("; sent by channel 1") for w in signals_of(frames(1), vehicle, plain).warnings
    )
    only = replace(vehicle, signals={"input_shaft_speed": vehicle.signals["input_shaft_speed"]})
    of_0 = replace(dbc, messages={n: replace(m, channel=0) for n, m in dbc.messages.items()})
    with pytest.raises(ClutchestError, match=r"GETR_1 on channel 1, MOTOR_1 on channel 1, where"):
        signals_of(frames(1), only, of_0)


def test_gears_that_are_never_sent_are_named(edited, tmp_path) -> None:
    """With them the shaft is never known, though its signal is there."""
    geared = 'noise = 0.06\ngears = [12, 8]\ngear = { signal = "MUX" }\ngear_numbers = [4, 5]\n'
    dbc = OWN.replace(" M :", " :").replace(" m0 :", " :")
    path = own(
        edited,
        tmp_path,
        ('"nEin"\nunit = "rpm"\nnoise = 0.06\n', f'"nEin"\nunit = "rpm"\n{geared}'),
        dbc=dbc,
    )
    vehicle = load_vehicle(path)
    signals = signals_of(frames(), vehicle, load_database(vehicle))
    assert "input_shaft_speed: GETR_1.MUX has 1, never one of the gears 4, 5" in signals.warnings


def test_inspect_says_on_which_channel_a_database_fits(tmp_path) -> None:
    (tmp_path / "own.dbc").write_text(OWN, encoding="utf-8")
    with pytest.raises(
        ClutchestError, match=r"own\.dbc: 2 of 2 ids of own\.log .* on channel 0; exp"
    ):
        inspect_logs([candump(tmp_path, 0.005)], [DatabaseFile(tmp_path / "own.dbc", 1)])


def test_convert_says_what_decoding_warns_of(edited, tmp_path) -> None:
    path = edited(('"EngineSpeed"\nunit = "rpm"\n', '"EngineSpeed"\nunit = "rpm"\nmax = 700\n'))
    log = shipped("logs")["demo"]
    read = Conversion.of([str(log)], tmp_path / "r.csv", load_vehicle(path))
    assert any("samples outside the vehicle file's min … max" in note for note in read.notes)


def test_a_byte_order_mark_is_no_key(edited) -> None:
    path = edited()
    path.write_text("\ufeff" + path.read_text(encoding="utf-8"), encoding="utf-8")
    assert load_vehicle(path).name == "truck"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("noise = 0.06", "noise = 0,06", "; a number has a decimal point"),
        ("value = 6.51", "value = 6,51", "; a number has a decimal point"),
        ("noise = 0.06", "noise = 0.06\nnoise = 0.07", "; the key stands there twice"),
        ('"hdt_clutch.dbc"', r'"C:\daten\own.dbc"', "; expected / between the folders of a path"),
        ('"hdt_clutch.dbc"', r'"C:\user\own.dbc"', "; expected / between the folders of a path"),
    ],
)
def test_what_is_no_toml_says_what_is_expected(edited, old, new, words) -> None:
    with pytest.raises(ClutchestError, match=r"mine\.toml:\d+: not TOML: [^;]*" + words):
        load_vehicle(edited((old, new)))


def candump(tmp_path: Path, step: float) -> Path:
    """Both messages of ``OWN`` for 2 s, in a log whose clock has steps of ``step`` s."""
    lines = []
    for k in range(400):
        stamp = 1_700_000_000 + (k * 0.005 // step * step if step else 0.0)
        lines.append(f"({stamp:.6f}) can0 {(272, 256)[k % 2]:03X}#00{k % 250:02X}000900000000\n")
    path = tmp_path / "own.log"
    path.write_text("".join(lines), encoding="utf-8")
    return path


def test_a_clock_that_does_not_tell_samples_apart_is_named(edited, tmp_path) -> None:
    path = own(edited, tmp_path, (ENGINE, 'message = "MOTOR_1"\nsignal = "nIst"\n'))
    assert not any(
        "time of the sample before" in w for w in read_log(candump(tmp_path, 0.005), path).warnings
    )
    coarse = read_log(candump(tmp_path, 0.5), path)
    assert any(
        "own.log: samples of engine_speed, input_shaft_speed have the time of the sample before"
        in w
        for w in coarse.warnings
    )
    with pytest.raises(ClutchestError, match=r"own\.log: all samples have the same time; expected"):
        read_log(candump(tmp_path, 0.0), path)


def test_a_coarse_clock_and_absurd_numbers_are_filtered_without_warnings_of_numpy(edited) -> None:
    far = edited(('value = 6.51, unit = "mm"', 'value = 6.51, unit = "m"'))
    signals = read_log("demo", "truck", (0, 45))
    coarse = {n: replace(s, time=np.floor(s.time * 2.0) / 2.0) for n, s in signals.items()}
    assert "temp_disc" in replay(signals, far).summary["states"]
    assert "temp_disc" in replay(replace(signals, signals=coarse), "truck").summary["states"]


COLUMNS = """
[columns]
time = { column = "t", unit = "ms" }
engine_speed = { column = "n", unit = "rpm" }
"""


@pytest.mark.parametrize(
    ("line", "words"),
    [
        (
            'input_shaft_speed = { column = "n", unit = "rpm" }',
            "column 'n' is columns.engine_speed",
        ),
        ('accelerator_pedal = { column = "p", min = 5, max = 1 }', "min 5 is not below max 1"),
    ],
)
def test_columns_that_cannot_be(edited, line, words) -> None:
    with pytest.raises(ClutchestError, match=rf"mine\.toml:\d+: .*{words}"):
        load_vehicle(edited(extra=f"{COLUMNS}{line}\n"))


def test_times_in_a_unit_that_is_too_short_for_them(edited, tmp_path) -> None:
    rows = "".join(f"{k * 0.01:.2f},{600 + k % 7}\n" for k in range(100))
    (tmp_path / "t.csv").write_text("t,n\n" + rows, encoding="utf-8")
    with pytest.raises(ClutchestError, match=r"t\.csv: its rows are 1e-05 s apart by the unit"):
        read_log(tmp_path / "t.csv", edited(extra=COLUMNS))


def test_frames_of_another_sender_are_named_where_the_dbc_is_not_of_j1939(edited, tmp_path) -> None:
    """Its message is sent by 0x05, not by 0x00."""
    dbc = OWN.replace("BO_ 256", "BO_ 2364540158")
    dbc += 'BA_DEF_ "ProtocolType" STRING ;\nBA_DEF_DEF_ "ProtocolType" "";\n'
    path = own(edited, tmp_path, (ENGINE, 'message = "MOTOR_1"\nsignal = "nIst"\n'), dbc=dbc)
    vehicle = load_vehicle(path)
    sent = frames()
    motor = sent.id == 256
    moved = replace(
        sent,
        id=np.where(motor, 0x0CF00405, sent.id).astype(np.uint32),
        flags=np.where(motor, Flag.EXTENDED, 0).astype(np.uint8),
    )
    (words,) = (
        w
        for w in signals_of(moved, vehicle, load_database(vehicle)).warnings
        if "MOTOR_1 has no" in w
    )
    assert words.endswith("; 0x0CF00405 would be MOTOR_1 if the DBC said that it is J1939")


def test_a_channel_that_is_no_number(edited) -> None:
    path = edited(('"hdt_clutch.dbc"', '{ file = "hdt_clutch.dbc", channel = "0" }'))
    with pytest.raises(ClutchestError, match=r"mine\.toml:\d+: dbc\.channel must be an integer"):
        load_vehicle(path)
