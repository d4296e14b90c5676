"""Tables as engineers have them: any names, units and clocks, without a bus."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import clutchest
from clutchest.errors import ClutchestError
from clutchest.reading import read_log
from clutchest.reading.table_inspection import inspect_tables
from clutchest.vehicle import TableColumn, dump_vehicle, load_vehicle
from table_rows import RPM, SPEED, TIME, N, written


def only_columns(truck, **columns: TableColumn):
    """The truck without a bus: its file maps columns alone."""
    signals = {
        name: replace(s, bus=replace(s.bus, message="", signal="", unit=truck.machine.units[name]))
        for name, s in truck.signals.items()
        if name in columns
    }
    signals = {
        n: replace(s, reference=None, fraction=None, friction=None) for n, s in signals.items()
    }
    return replace(truck, dbc=(), checked=(), signals=signals, columns=columns)


@pytest.mark.parametrize(
    ("header", "times", "speeds"),
    [
        ("time,engine_speed [rpm]", TIME, SPEED / RPM),
        ("Time (ms),engine_speed (1/min)", 1e3 * TIME, SPEED / RPM),
        ("t [s],Engine_Speed [rad/s]", TIME, SPEED),
        ("time_ms,engine_speed", 1e3 * TIME, SPEED),
        ("Time [s],Engine Speed [rpm]", TIME, SPEED / RPM),
        ("Time,ENGINE-SPEED", TIME, SPEED),
        ("time,EngineSpeed", TIME, SPEED),
        ("time_ms,engineSpeed [rpm]", 1e3 * TIME, SPEED / RPM),
        ("time,engine_speed_rpm", TIME, SPEED / RPM),
        ("time,Engine_Speed_RPM", TIME, SPEED / RPM),
        ("time,engine_speed_rad_s", TIME, SPEED),
        (",time,engine_speed [rpm]", TIME, SPEED / RPM),  # an index in front
    ],
)
def test_headers_state_units(header, times, speeds, truck, tmp_path):
    index = header.startswith(",")
    rows = [
        f"{f'{k},' if index else ''}{t!r},{v!r}"
        for k, (t, v) in enumerate(zip(times.tolist(), speeds.tolist(), strict=True))
    ]
    signals = read_log(written(tmp_path, "\n".join([header, *rows])), truck)
    np.testing.assert_allclose(signals["engine_speed"].time, TIME, atol=1e-9)
    np.testing.assert_allclose(signals["engine_speed"].value, SPEED, rtol=1e-12)
    assert signals.warnings == ()


def test_a_second_row_of_units_and_german_numbers(truck, tmp_path):
    rows = [
        f"{1e3 * t:.1f};{v:.6f}".replace(".", ",") for t, v in zip(TIME, SPEED / RPM, strict=True)
    ]
    path = written(tmp_path, "\n".join(["Zeit;engine_speed", "ms;rpm", *rows]))
    speed = read_log(path, truck)["engine_speed"]
    np.testing.assert_allclose(speed.time, TIME, atol=1e-9)
    np.testing.assert_allclose(speed.value, SPEED, rtol=1e-6)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "latin-1"])
def test_semicolons_with_decimal_points_tabs_and_encodings(encoding, truck, tmp_path):
    for separator in (";", "\t"):
        rows = [f"{t:.2f}{separator}{v!r}" for t, v in zip(TIME, SPEED.tolist(), strict=True)]
        text = "\n".join(
            [f"time{separator}engine_speed{separator}\xfcbrig", *[r + separator for r in rows]]
        )
        path = tmp_path / "a.csv"
        path.write_bytes(text.encode(encoding))
        np.testing.assert_array_equal(read_log(path, truck)["engine_speed"].value, SPEED)


def test_a_vehicle_file_of_columns_alone(truck, tmp_path):
    vehicle = only_columns(
        truck,
        time=TableColumn("t", "ms"),
        engine_speed=TableColumn("nEng [rpm]", "rpm"),
        slave_position=TableColumn("xSlave", "m"),
        engine_torque=TableColumn("MEng"),
    )
    text = tmp_path / "v.toml"
    dump_vehicle(vehicle, text)
    again = load_vehicle(text)
    assert again.columns == vehicle.columns and again.dbc == ()
    assert {n: s.noise for n, s in again.signals.items()} == {
        n: s.noise for n, s in vehicle.signals.items()
    }
    x = 38.4 + 0.01 * np.sin(TIME)
    torque = 900.0 + 700.0 * np.sin(TIME)
    table = pd.DataFrame(
        {"t": 1e3 * TIME, "nEng [rpm]": SPEED / RPM, "xSlave": x / 1e3, "MEng": torque, "other": x}
    )
    table.to_csv(tmp_path / "a.csv", index=False)
    for given in (tmp_path / "a.csv", table):
        signals = read_log(given, again)
        np.testing.assert_allclose(signals["engine_speed"].value, SPEED, rtol=1e-12)
        np.testing.assert_allclose(signals["slave_position"].value, x, rtol=1e-12)
        np.testing.assert_allclose(signals["engine_torque"].value, torque)
        assert signals.warnings == ()
    signals.to_pandas().to_parquet(tmp_path / "canonical.parquet")  # as convert writes them
    back = read_log(tmp_path / "canonical.parquet", again)
    for name in ("engine_speed", "slave_position", "engine_torque"):
        np.testing.assert_array_equal(back[name].value, signals[name].value)
        np.testing.assert_array_equal(back[name].time, signals[name].time)


def test_the_shortest_columns_take_the_noise_of_the_template(truck, tmp_path):
    text = truck.path.read_text(encoding="utf-8")
    head, _, rest = text.partition("[signals.engine_speed]")
    parameters = rest[rest.index("[parameters]") :]
    head = head.replace('dbc = ["hdt_clutch.dbc"]', "").replace('checked = ["ClutchActuator"]', "")
    columns = (
        '[columns]\nengine_speed = { column = "nEng [rpm]", unit = "rpm" }\n'
        'engine_torque = { column = "M", unit = "%", reference = { value = 3.5, unit = "kNm" } }\n'
    ).replace('value = 3.5, unit = "kNm"', 'value = 3500, unit = "Nm"')
    path = written(tmp_path, head + columns + parameters, "v.toml")
    vehicle = load_vehicle(path)
    assert vehicle.signals["engine_speed"].noise == truck.signals["engine_speed"].noise
    assert vehicle.signals["engine_speed"].noise_source == "guess: the shipped truck's"
    share = np.round(20.0 + 30.0 * np.sin(TIME))
    frame = pd.DataFrame({"time": TIME, "nEng [rpm]": SPEED / RPM, "M": share})
    signals = read_log(frame, vehicle)
    np.testing.assert_allclose(signals["engine_torque"].value, 35.0 * share)
    wrong = written(tmp_path, path.read_text().replace('unit = "rpm"', 'unit = "mm"'), "w.toml")
    with pytest.raises(ClutchestError, match=r"w\.toml:\d+: unit 'mm' of columns\.engine_speed"):
        load_vehicle(wrong)
    wrong = written(tmp_path, path.read_text().replace("engine_speed =", "engin_speed ="), "w.toml")
    with pytest.raises(ClutchestError, match="did you mean 'engine_speed'"):
        load_vehicle(wrong)


def test_a_column_that_is_not_there_is_named(truck, tmp_path):
    vehicle = only_columns(truck, engine_speed=TableColumn("nEng"), engine_torque=TableColumn("M"))
    frame = pd.DataFrame({"time": TIME, "nEng": SPEED, "Mx": SPEED})
    assert any("no column 'M' (engine_torque)" in w for w in read_log(frame, vehicle).warnings)
    with pytest.raises(ClutchestError, match="no known signal among its columns: a, b"):
        read_log(pd.DataFrame({"time": TIME, "a": SPEED, "b": SPEED}), vehicle)


WRONG = {
    "rpm as rad/s": ({"engine_speed": SPEED / RPM}, "is it in rpm"),
    "rad/s as rpm": ({"engine_speed [rpm]": SPEED}, "is it in rad/s"),
    "shaft alone in rpm": (
        {"engine_speed": SPEED, "input_shaft_speed": SPEED / RPM},
        "input_shaft_speed .* in rpm",
    ),
    "position in m": (
        {"engine_speed": SPEED, "slave_position": 0.0384 + 1e-5 * SPEED},
        "is it in m",
    ),
    "torque in percent": (
        {"engine_speed": SPEED, "engine_torque": np.round(30 + 20 * np.sin(TIME))},
        "is it in %",
    ),
    "torque in fine percent": (
        {"engine_speed": SPEED, "engine_torque": 30 + 20 * np.sin(TIME)},
        "is it in %",
    ),
    "kelvin": ({"engine_speed": SPEED, "coolant_temp": 358.0 + 0.0 * TIME}, "is it in K"),
    "fahrenheit": ({"engine_speed": SPEED, "coolant_temp": 190.0 + 0.0 * TIME}, "is it in °F"),
    "km/h as m/s": ({"engine_speed": SPEED, "vehicle_speed": 80.0 + 0.1 * SPEED}, "is it in km/h"),
    "percent stated": ({"engine_speed": SPEED, "engine_torque [%]": SPEED}, "reference"),
    "another quantity": ({"engine_speed [mm]": SPEED}, "in mm, expected a unit of engine_speed"),
}


@pytest.mark.parametrize("case", WRONG)
def test_values_that_do_not_fit_their_unit_are_refused(case, truck, tmp_path):
    columns, words = WRONG[case]
    frame = pd.DataFrame({"time": TIME, **columns})
    with pytest.raises(ClutchestError, match=words):
        read_log(frame, truck)
    frame.to_csv(tmp_path / "a.csv", index=False)
    with pytest.raises(ClutchestError, match=rf"a\.csv: .*{words}"):
        read_log(tmp_path / "a.csv", truck)


@pytest.mark.parametrize(("step", "asked"), [(0.25, True), (0.3, False)])
def test_a_draft_asks_whether_a_torque_is_in_percent(tmp_path, step, asked):
    """What its largest torque is, it does not know, so that nothing can be refused."""
    torque = step * np.round((30.0 + 20.0 * np.sin(TIME)) / step)
    frame = pd.DataFrame({"time": TIME, "engine_speed": SPEED, "engine_torque": torque})
    frame.to_csv(tmp_path / "a.csv", index=False)
    inspection = inspect_tables([tmp_path / "a.csv"])
    assert any("in %? Then state that unit" in words for words in inspection.warnings) == asked
    inspection.write_vehicle(tmp_path / "v.toml", tmp_path / "v.toml")
    warnings = read_log(tmp_path / "a.csv", tmp_path / "v.toml").warnings
    assert any("engine_torque_max, which is a guess" in words for words in warnings) == asked


def test_milliseconds_taken_for_seconds_are_refused(truck):
    frame = pd.DataFrame({"time": 10.0 * np.arange(N), "engine_speed": SPEED})
    with pytest.raises(ClutchestError, match=r"10 s apart.* is the time in ms.*\[modes\] gap"):
        read_log(frame, truck)


def test_readings_about_zero_say_nothing_of_their_unit(truck):
    noise = 0.01 * np.random.default_rng(1).standard_normal(N)
    frame = pd.DataFrame(
        {
            "time": TIME,
            "engine_speed": 65.0 + noise,
            "engine_torque": 3.0 + 100 * noise,
            "input_shaft_speed": noise,
            "motor_position": np.abs(noise),
            "vehicle_speed": 0.0,
            "coolant_temp": 20.0,
        }
    )
    assert set(read_log(frame, truck)) == set(frame.columns) - {"time"}


def test_kelvin_that_is_stated(truck):
    frame = pd.DataFrame({"time": TIME, "engine_speed": SPEED, "coolant_temp [K]": 358.15})
    np.testing.assert_allclose(read_log(frame, truck)["coolant_temp"].value, 85.0)


def test_excel(truck, tmp_path):
    pytest.importorskip("openpyxl")
    frame = pd.DataFrame({"time [ms]": 1e3 * TIME, "engine_speed [rpm]": SPEED / RPM})
    frame.to_excel(tmp_path / "a.xlsx", index=False)
    np.testing.assert_allclose(read_log(tmp_path / "a.xlsx", truck)["engine_speed"].value, SPEED)
    (tmp_path / "b.xlsx").write_bytes(b"PK no more")
    with pytest.raises(ClutchestError, match=r"b\.xlsx: not a readable table"):
        read_log(tmp_path / "b.xlsx", truck)


def test_units_in_metadata(truck, tmp_path):
    import pyarrow as pa
    import pyarrow.parquet as pq

    fields = [
        pa.field("time", pa.float64()),
        pa.field("engine_speed", pa.float64(), metadata={"unit": "rpm"}),
    ]
    pq.write_table(pa.table([TIME, SPEED / RPM], schema=pa.schema(fields)), tmp_path / "a.parquet")
    np.testing.assert_allclose(read_log(tmp_path / "a.parquet", truck)["engine_speed"].value, SPEED)
    frame = pd.DataFrame({"engine_speed": SPEED / RPM}, index=pd.Index(TIME, name="time"))
    frame.attrs["units"] = {"engine_speed": "rpm"}
    np.testing.assert_allclose(read_log(frame, truck)["engine_speed"].value, SPEED)


def measurement(path: Path) -> Path:
    from asammdf import MDF, Signal

    with MDF(version="4.10") as mdf:
        mdf.header.start_time = pd.Timestamp("2024-01-18T09:30:00Z").to_pydatetime()
        mdf.append([Signal(SPEED / RPM, TIME, name="nEng", unit="rpm")])
        slow = TIME[::10]
        mdf.append(
            [
                Signal(np.full(len(slow), 85, np.uint8), slow, name="coolant_temp", unit="degC"),
                Signal(np.array([b"on"] * len(slow)), slow, name="state", encoding="utf-8"),
            ]
        )
        mdf.save(path, overwrite=True)
    return path


def test_a_measurement_in_mf4(truck, tmp_path):
    vehicle = only_columns(
        truck, engine_speed=TableColumn("nEng"), coolant_temp=TableColumn("coolant_temp")
    )
    signals = read_log(measurement(tmp_path / "m.mf4"), vehicle)
    np.testing.assert_allclose(signals["engine_speed"].value, SPEED)
    np.testing.assert_allclose(signals["engine_speed"].time, TIME, atol=1e-9)
    assert len(signals["coolant_temp"]) == N // 10 and signals["coolant_temp"].value[0] == 85.0
    assert signals.start_ns == pd.Timestamp("2024-01-18T09:30:00Z").value
    with pytest.raises(ClutchestError, match="channel 'state': holds no numbers"):
        read_log(tmp_path / "m.mf4", only_columns(truck, engine_speed=TableColumn("state")))


def test_what_is_no_table_is_refused(truck):
    for given in ({"a": 1}, 3.0):
        with pytest.raises(ClutchestError):
            read_log(given, truck)  # type: ignore[arg-type]


def test_a_drive_of_a_table_equals_that_of_its_log(truck, tmp_path):
    """The whole way without a bus: the same estimates from a table with names of its own."""
    signals = clutchest.simulate(truck, "launches", 1, duration=20.0)
    run = clutchest.replay(signals, truck)
    columns = {name: TableColumn(f"x_{name}", truck.machine.units[name]) for name in signals}
    vehicle = only_columns(truck, **columns)
    table = signals.to_pandas().rename(columns={name: f"x_{name}" for name in signals})
    again = clutchest.replay(read_log(table, vehicle), vehicle)
    a, b = run.to_pandas(), again.to_pandas()
    np.testing.assert_allclose(b["temp_disc"], a["temp_disc"], rtol=1e-9)
    np.testing.assert_allclose(b["clutch_torque"], a["clutch_torque"], rtol=1e-6, atol=1e-6)


def test_a_draft_from_a_table_replays_at_once(truck, tmp_path):
    """Names of a stranger, units stated or not: the drafted vehicle file reads the same signals."""
    from clutchest.reading.table_inspection import inspect_tables

    signals = clutchest.simulate(truck, "launches", 2, duration=30.0)
    table = signals.to_pandas()
    strange = pd.DataFrame(
        {
            "t": 1e3 * table["time"],
            "nMot [1/min]": table["engine_speed"] / RPM,
            "Getriebeeingangsdrehzahl": table["input_shaft_speed"] / RPM,
            "MMot": table["engine_torque"],
            "xSlave": table["slave_position"] / 1e3,
            "Actuator travel": table["motor_position"],
            "K\xfchlmitteltemp [K]": table["coolant_temp"] + 273.15,
            "vehicle speed": table["vehicle_speed"] * 3.6,
            "comment": "x",
        }
    )
    strange.to_csv(tmp_path / "strange.csv", index=False)
    found = inspect_tables([tmp_path / "strange.csv"])
    assert found.machine.name == "dry_clutch" and found.missing == ()
    assert found.duration_s == pytest.approx(signals.end, abs=0.1)
    target = tmp_path / "vehicle.toml"
    found.write_vehicle(target, target)
    drafted = load_vehicle(target)
    again = read_log(tmp_path / "strange.csv", drafted)
    wanted = set(signals) - {"ambient_temp", "vehicle_speed"}
    assert wanted <= set(again)
    for name in wanted:
        a, b = signals[name].only_valid(), again[name].only_valid()
        np.testing.assert_allclose(b.value, a.value, rtol=1e-9, atol=1e-9)
    assert any("states no unit; by its values it is in m" in w for w in found.warnings)


def test_a_vehicle_without_a_bus_is_simulated_as_a_table(truck, tmp_path):
    from clutchest.simulated import write_simulation

    vehicle = only_columns(
        truck,
        engine_speed=TableColumn("nEng", "rpm"),
        engine_torque=TableColumn("MEng"),
        input_shaft_speed=TableColumn("nIn"),
        slave_position=TableColumn("x", "m"),
    )
    write_simulation(tmp_path / "a.csv", vehicle, "launches", 1, duration=10.0)
    assert list(pd.read_csv(tmp_path / "a.csv").columns) == ["time", "nEng", "MEng", "nIn", "x"]
    signals = read_log(tmp_path / "a.csv", vehicle)
    assert 60.0 < np.median(signals["engine_speed"].value) < 110.0
    with pytest.raises(ClutchestError, match="maps no message"):
        write_simulation(tmp_path / "a.log", vehicle, "launches", 1, duration=10.0)


def test_names_that_end_in_a_unit(truck, tmp_path):
    frame = pd.DataFrame(
        {
            "time_s": TIME,
            "engine_speed_rpm": SPEED / RPM,
            "vehicle_speed_kmh": np.full(N, 36.0),
            "coolant_temp_K": np.full(N, 353.15),
            "ambient_temp_degF": np.full(N, 50.0),
            "slave_position_mm": np.linspace(2.0, 20.0, N),
        }
    )
    frame.to_csv(tmp_path / "a.csv", index=False, sep="|")
    log = read_log(tmp_path / "a.csv", truck)
    np.testing.assert_allclose(log["engine_speed"].value, SPEED)
    for name, value in (("vehicle_speed", 10.0), ("coolant_temp", 80.0), ("ambient_temp", 10.0)):
        np.testing.assert_allclose(log[name].value, value)
    np.testing.assert_allclose(log["slave_position"].value, np.linspace(2.0, 20.0, N))


PREAMBLES = {
    "comments": "# logger 4711; of 2024\n# made by hand, twice\n",
    "excel": "sep=;\n",
    "words": "Measurement of today\n\n",
    "none": "",
}


@pytest.mark.parametrize("what", PREAMBLES)
def test_lines_before_the_header(truck, tmp_path, what):
    frame = pd.DataFrame({"time [s]": TIME, "engine_speed [rpm]": SPEED / RPM})
    text = PREAMBLES[what] + frame.to_csv(index=False, sep=";", decimal=",")
    (tmp_path / "a.csv").write_text(text)
    np.testing.assert_allclose(read_log(tmp_path / "a.csv", truck)["engine_speed"].value, SPEED)
    rows = text.splitlines()
    rows[-1] = "x" + rows[-1]
    (tmp_path / "a.csv").write_text("\n".join(rows))
    assert f"row {len(rows)}" in " ".join(read_log(tmp_path / "a.csv", truck).warnings)
