from __future__ import annotations

import gzip
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from clutchest.can.files import write_frames
from clutchest.can.frames import Frames
from clutchest.errors import ClutchestError
from clutchest.reading import read_log
from clutchest.reading.tables import write_signals
from clutchest.reading.window import TimeWindow
from clutchest.shipped import shipped
from clutchest.signals import Signal, Signals
from clutchest.simulated import write_simulation
from clutchest.vehicle import load_vehicle

RPM = np.pi / 30


@pytest.fixture
def logs(send, tmp_path: Path):
    """Writes engine-speed logs that start at the given s and last the given s."""

    def write(name: str, start: float, lasts: float = 1.0, **changes: object) -> Path:
        frames = send("EEC1", start=start, EngineSpeed=np.linspace(600, 700, round(100 * lasts)))
        write_frames(replace(frames, **changes), tmp_path / name)
        return tmp_path / name

    return write


def test_pieces_of_one_drive_are_joined_in_order_of_time(logs, truck) -> None:
    second, first = logs("b.log", 31.0), logs("a.log", 0.0)
    signals = read_log([second, first], truck)
    assert len(signals.drives) == 1
    speed = signals["engine_speed"]
    assert len(speed) == 200 and speed.time[0] == 0.0
    assert speed.time[100] == pytest.approx(31.0)
    assert signals.counts.frames == 200 and len(signals.sources) == 2


def test_logs_far_apart_are_drives_of_their_own(logs, truck) -> None:
    late, early = logs("late.log", 200.0), logs("early.log", 0.0, lasts=2.0)
    signals = read_log([late, early], truck)
    assert [len(drive["engine_speed"]) for drive in signals.drives] == [200, 100]  # by the clock
    assert all(drive["engine_speed"].time[0] == 0.0 for drive in signals.drives)
    assert signals.start_ns == signals.later[0].start_ns - 200 * 10**9


def test_a_piece_that_bridges_two_others_makes_one_drive(logs, truck) -> None:
    paths = [logs("a.log", 0.0), logs("c.log", 110.0), logs("b.log", 50.0, lasts=20.0)]
    assert len(read_log(paths, truck).drives) == 1


def test_a_long_silence_starts_a_new_drive(logs, send, truck, tmp_path: Path) -> None:
    parts = [send("EEC1", start=s, EngineSpeed=[600.0] * 50) for s in (0.0, 7200.0)]
    stray = send("ETC2", start=20_000.0, CurrentGear=[1.0])  # nothing mapped behind it
    write_frames(Frames.concatenate([*parts, stray]), tmp_path / "day.log")
    signals = read_log(tmp_path / "day.log", truck)
    assert [round(drive.end, 2) for drive in signals.drives] == [0.49, 0.49]
    assert any("no frame of" in w for w in signals.warnings)


def test_a_log_that_is_left_out_is_named(logs, send, truck, tmp_path: Path) -> None:
    one = logs("one.log", 0.0, lasts=20.0)
    beside, later = tmp_path / "beside.log", tmp_path / "later.log"
    write_frames(send("ETC2", start=1.0, CurrentGear=[1.0] * 50), beside)  # within the other's time
    write_frames(send("ETC2", start=500.0, CurrentGear=[1.0] * 50), later)
    for other in (beside, later):
        words = read_log([one, other], truck).warnings
        assert [w for w in words if w.startswith(f"left out: {other}: no frame ")], other
    short = logs("short.log", 500.0, lasts=2.0)
    window = TimeWindow.parse("5", None)
    words = read_log([one, short], truck, window).warnings
    assert [w for w in words if w.startswith(f"left out: {short}: no data in the time window")]
    for path in (one, short):
        write_signals(read_log(path, truck), path.with_suffix(".parquet"))
    tables = [path.with_suffix(".parquet") for path in (one, short)]
    words = read_log(tables, truck, window).warnings
    assert [w for w in words if w.startswith(f"left out: {tables[1]}: no data in the time window")]
    assert not [w for w in read_log([one, short], truck).warnings if "left out" in w]


def test_relative_clocks_do_not_join(tmp_path: Path, truck) -> None:
    line = " ({:010.6f})  can0  0CF00400   [8]  FF FF FF C0 12 FF FF FF\n"
    for name in ("a.log", "b.log"):
        (tmp_path / name).write_text("".join(line.format(0.01 * i) for i in range(50)))
    signals = read_log([tmp_path / "a.log", tmp_path / "b.log"], truck)
    assert len(signals.drives) == 2 and signals.start_ns is None
    assert signals["engine_speed"].value[0] == pytest.approx(0x12C0 * 0.125 * RPM)


def test_a_log_without_mapped_messages_says_so(logs, send, truck, tmp_path: Path) -> None:
    write_frames(send("ETC2", CurrentGear=[1.0]), tmp_path / "other.log")
    with pytest.raises(ClutchestError, match=r"other\.log: no frame of EEC1.*the log holds ETC2"):
        read_log(tmp_path / "other.log", truck)
    with pytest.raises(ClutchestError, match=r"no such file: nowhere\.log"):
        read_log("nowhere.log", truck)
    with pytest.raises(ClutchestError, match="no log to read"):
        read_log([], truck)


def test_a_dbc_beside_the_log_is_found(logs, bus, edited, tmp_path: Path) -> None:
    vehicle_file = edited(('dbc = ["hdt_clutch.dbc"]', 'dbc = ["other.dbc"]'))
    vehicle = load_vehicle(vehicle_file)
    path = logs("a.log", 0.0)
    with pytest.raises(
        ClutchestError,
        match=r"no such DBC: other\.dbc; searched: the vehicle file's folder, ",
    ):
        read_log(path, vehicle)
    (tmp_path / "other.dbc").write_bytes(bus.paths[0].read_bytes())
    assert len(read_log(path, vehicle)["engine_speed"]) == 100


TABLE = """time,engine_speed,engine_torque,slave_position,Öltemperatur
0.0,100.0,,38.4,90
0.01,,500.0,38.5,90
0.02,102.0,,,90
"""


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1"])
def test_csv_of_canonical_columns(tmp_path: Path, truck, encoding: str) -> None:
    path = tmp_path / "decoded.csv"
    path.write_bytes(TABLE.encode(encoding))
    signals = read_log(path, truck)
    assert signals["engine_speed"].time.tolist() == [0.0, 0.02]
    assert signals["engine_torque"].value.tolist() == [500.0]
    assert signals["slave_position"].value.tolist() == [38.4, 38.5]
    assert signals["slave_position"].unit == "mm"
    assert any("'Öltemperatur' ignored" in w for w in signals.warnings)
    (tmp_path / "copy.csv.gz").write_bytes(gzip.compress(TABLE.encode(encoding)))
    assert read_log(tmp_path / "copy.csv.gz", truck)["engine_speed"].value.tolist() == [100, 102]


def test_csv_with_semicolons_and_decimal_commas(tmp_path: Path, truck) -> None:
    path = tmp_path / "decoded.csv"
    path.write_text("time;engine_speed\n0,0;100,5\n0,5;101,5\n")
    signals = read_log(path, truck)
    assert signals["engine_speed"].value.tolist() == [100.5, 101.5]
    assert signals["engine_speed"].time.tolist() == [0.0, 0.5]


def test_rows_out_of_order_are_reported_and_sorted(tmp_path: Path, truck) -> None:
    path = tmp_path / "decoded.csv"
    path.write_text("time,engine_speed\n0.0,100\n0.2,102\n,7\n0.1,101\n0.3,103\n")
    signals = read_log(path, truck)
    assert signals["engine_speed"].value.tolist() == [100, 101, 102, 103]
    assert any(
        w == "decoded.csv: row 5: the time goes back (1 time, by 0.1 s at most); rows are taken in "
        "order of time"
        for w in signals.warnings
    )


def test_the_vehicle_files_range_holds_for_tables_too(edited, tmp_path: Path) -> None:
    vehicle = load_vehicle(edited(("[signals.engine_speed]", "[signals.engine_speed]\nmax = 3000")))
    path = tmp_path / "decoded.csv"
    path.write_text("time,engine_speed\n0.0,100\n0.1,400\n0.2,102\n")
    signals = read_log(path, vehicle)
    assert signals["engine_speed"].valid.tolist() == [True, False, True]
    assert "engine_speed: 1 samples outside the vehicle file's min … max" in signals.warnings


def test_what_was_made_of_a_log_is_none(tmp_path: Path) -> None:
    made = write_simulation(tmp_path / "a.csv", load_vehicle("truck"), "launches", 1, duration=10.0)
    with pytest.raises(ClutchestError, match="is a result of clutchest, expected a"):
        read_log(made, "truck")


def test_a_file_that_is_not_there_has_its_like_named(tmp_path: Path, truck) -> None:
    (tmp_path / "monday.log").touch()
    with pytest.raises(ClutchestError, match=r"mondy\.log; did you mean 'monday\.log'\?"):
        read_log(tmp_path / "mondy.log", truck)


def test_bad_cells_are_reported_and_the_good_kept(tmp_path: Path, truck) -> None:
    path = tmp_path / "decoded.csv"
    path.write_text("time,engine_speed\n0.0,100\n0.1,oops\nx,102\n0.3,inf\n0.4,104\n")
    signals = read_log(path, truck)
    speed = signals["engine_speed"]
    assert speed.time.tolist() == [0.0, 0.1, 0.3, 0.4]
    assert speed.value[speed.valid].tolist() == [100.0, 104.0]
    assert any("row 3: engine_speed 'oops' is not a number" in w for w in signals.warnings)
    assert any("row 4: time 'x' is not a number" in w for w in signals.warnings)
    assert signals.counts.rejected == {"no time": 1}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time,engin_speed\n0,1\n", "no known signal .*engin_speed; did you mean 'engine_speed'"),
        ("x,engine_speed\n0,1\n", r"no column of times, .* time, t, .*; it has x, engine_speed"),
        ("", "the file is empty"),
        ("time,engine_speed\n,1\n", "no row with a time"),
        ("time,engine_speed,engine_speed\n0,1,2\n", "column"),
    ],
)
def test_tables_that_cannot_be_read(tmp_path: Path, truck, text: str, message: str) -> None:
    path = tmp_path / "decoded.csv"
    path.write_text(text)
    if "engine_speed,engine_speed" in text:  # pandas renames the second one: it is ignored
        assert any(message in w for w in read_log(path, truck).warnings)
        return
    with pytest.raises(ClutchestError, match=message):
        read_log(path, truck)


def test_parquet_that_is_none(tmp_path: Path, truck) -> None:
    (tmp_path / "x.parquet").write_bytes(b"PAR1 no more")
    with pytest.raises(ClutchestError, match=r"x\.parquet: not a readable table"):
        read_log(tmp_path / "x.parquet", truck)


def test_a_signal_without_noise_in_the_file_is_ignored(tmp_path: Path) -> None:
    path = tmp_path / "decoded.csv"
    path.write_text("time,engine_speed,slave_position,ambient_temp\n0,100,38,20\n1,101,38,20\n")
    signals = read_log(path, load_vehicle("gt350"))
    assert set(signals) == {"engine_speed", "ambient_temp"}
    assert any(
        "'slave_position' ignored: gt350.toml does not map it" in w for w in signals.warnings
    )


def test_tables_on_one_clock_are_joined(tmp_path: Path, truck) -> None:
    for name, start in (("a", 1.7e9), ("b", 1.7e9 + 30), ("c", 1.7e9 + 5000)):
        (tmp_path / f"{name}.csv").write_text(f"time,engine_speed\n{start},100\n{start + 1},101\n")
    signals = read_log([tmp_path / f"{n}.csv" for n in "abc"], truck)
    assert len(signals.drives) == 2
    assert signals["engine_speed"].time.tolist() == [0.0, 1.0, 30.0, 31.0]
    assert signals.start_ns == 1_700_000_000_000_000_000


@pytest.mark.parametrize("suffix", [".csv", ".csv.gz", ".parquet", ".mf4"])
def test_what_is_written_reads_back(tmp_path: Path, truck, suffix: str) -> None:
    rng = np.random.default_rng(1)
    signals = Signals(
        {
            "engine_speed": Signal.of(
                "engine_speed", "rad/s", np.arange(50) * 0.01, rng.normal(100, 1, 50)
            ),
            "slave_position": Signal.of(
                "slave_position", "mm", np.arange(30) * 0.02 + 0.003, rng.normal(40, 1, 30)
            ),
        }
    )
    write_signals(signals, tmp_path / f"x{suffix}")
    copy = read_log(tmp_path / f"x{suffix}", truck)
    for name in signals:
        assert np.array_equal(copy[name].time, signals[name].time)
        assert np.array_equal(copy[name].value, signals[name].value)


def test_table_leaves_invalid_samples_empty() -> None:
    speed = Signal.of("engine_speed", "rad/s", np.array([0.0, 1.0]), np.array([1.0, np.nan]))
    table = Signals({"engine_speed": speed}).to_pandas()
    assert table["engine_speed"].isna().tolist() == [False, True]


def test_a_table_holds_one_drive(tmp_path: Path) -> None:
    two = Signals({}, later=(Signals({}),))
    with pytest.raises(ClutchestError, match="a table holds one drive, not 2"):
        write_signals(two, tmp_path / "x.csv")
    with pytest.raises(ClutchestError, match=r"written as \.csv, .*\.mcap"):
        write_signals(Signals({}), tmp_path / "x.ods")


def test_a_log_given_twice_does_not_count_twice(logs, truck) -> None:
    one = logs("a.log", 0.0)
    with pytest.raises(ClutchestError, match="given twice"):
        read_log([one, one.parent / "." / "a.log"], truck)


def test_a_folder_is_no_log(tmp_path: Path, truck) -> None:
    with pytest.raises(ClutchestError, match="is a folder, expected a file; clutchest fleet takes"):
        read_log(tmp_path, truck)
    (tmp_path / "monday.log").write_text("")
    with pytest.raises(ClutchestError, match=r"such as .*monday\.log; clutchest fleet"):
        read_log(tmp_path, truck)


@pytest.mark.parametrize("kind", ["dates", "dates with a zone", "spans", "index"])
def test_parquet_with_other_times(tmp_path: Path, truck, kind: str) -> None:
    seconds = np.array([0.0, 0.5, 1.0])
    table = pd.DataFrame({"time": seconds, "engine_speed": [60.0, 61.0, 62.0]})
    if kind == "index":
        table = table.set_index("time")
    else:
        table["time"] = (
            pd.to_timedelta(seconds, unit="s")
            if kind == "spans"
            else pd.to_datetime(1.7e9 + seconds, unit="s", utc=kind.endswith("zone"))
        )
    table.to_parquet(tmp_path / "x.parquet")
    signals = read_log(tmp_path / "x.parquet", truck)
    np.testing.assert_allclose(signals["engine_speed"].time, seconds, atol=1e-6)
    assert signals.start_ns == (1_700_000_000 * 10**9 if kind.startswith("dates") else None)


def test_times_below_zero_are_kept_and_reported(tmp_path: Path, truck) -> None:
    (tmp_path / "x.csv").write_text("time,engine_speed\n-2,60\n-1,61\n1,62\n")
    signals = read_log(tmp_path / "x.csv", truck)
    assert signals["engine_speed"].time.tolist() == [0.0, 1.0, 3.0] and signals.end == 3.0
    assert "begins at -2 s" in signals.warnings[0]


def test_the_same_frames_in_two_files_count_once(logs, truck) -> None:
    one, copy = logs("a.log", 0.0), logs("copy.mf4", 0.0)
    signals = read_log([one, copy], truck)
    assert len(signals["engine_speed"]) == 100
    assert dict(signals.counts.rejected) == {"duplicate": 100}


def test_a_clock_that_goes_back_is_reported_and_put_in_order(send, truck, tmp_path) -> None:
    frames = send("EEC1", EngineSpeed=np.linspace(600, 700, 100))
    frames.t_ns[40:60] -= 300_000_000
    write_frames(frames, tmp_path / "a.log")
    signals = read_log(tmp_path / "a.log", truck)
    assert len(signals["engine_speed"]) == 100
    assert np.all(np.diff(signals["engine_speed"].time) >= 0)
    assert any("a.log: the clock goes back 1 time, by 0.29 s" in w for w in signals.warnings)


def test_a_frame_that_is_logged_twice_counts_once(send, truck, tmp_path) -> None:
    frames = send("EEC1", EngineSpeed=np.linspace(600, 700, 100))
    copy = frames.take(np.arange(30, 50))
    write_frames(Frames.concatenate([frames, copy]).sorted(), tmp_path / "a.log")
    signals = read_log(tmp_path / "a.log", truck)
    assert len(signals["engine_speed"]) == 100
    assert signals.counts.rejected["duplicate"] == 20
    assert signals.counts.frames == 120


@pytest.mark.parametrize(
    ("signal", "unit", "other", "words"),
    [
        ("EngineSpeed", "rpm", "rad/s", "engine_speed of .* rad/s; is it in rpm"),
        ("MotorPosition", "mm", "m", "motor_position of .* in m; is it in mm"),
        ("EngineCoolantTemperature", "°C", "K", "coolant_temp of .* in K; is it in °C"),
    ],
)
def test_a_unit_that_only_the_vehicle_file_states_is_judged(signal, unit, other, words, tmp_path):
    """A DBC without units says nothing against rpm that are taken for rad/s."""
    dbc = shipped("dbc")["hdt_clutch"].read_text(encoding="utf-8")
    bare = re.sub(rf'( SG_ {signal} :.*\]) "[^"]*"', r'\1 ""', dbc)
    assert bare != dbc
    (tmp_path / "bare.dbc").write_text(bare, encoding="utf-8")
    text = shipped("vehicles")["truck"].read_text(encoding="utf-8").replace("hdt_clutch", "bare")
    right, stated = tmp_path / "right.toml", f'signal = "{signal}"\nunit = "{unit}"'
    right.write_text(text, encoding="utf-8")
    assert stated in text
    wrong = tmp_path / "wrong.toml"
    wrong.write_text(
        text.replace(stated, f'signal = "{signal}"\nunit = "{other}"'), encoding="utf-8"
    )
    assert len(read_log("demo", load_vehicle(right))["engine_speed"]) > 1000
    with pytest.raises(ClutchestError, match=f"demo.log.gz: {words}") as caught:
        read_log("demo", load_vehicle(wrong))
    assert "the database states no unit" in str(caught.value)
