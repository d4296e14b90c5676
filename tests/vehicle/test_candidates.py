"""Signals found by name in several languages, by range, and by behaviour where no name tells."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import clutchest
from clutchest.can.database import load
from clutchest.can.encode import encode
from clutchest.can.files import write_frames
from clutchest.can.frames import Frames
from clutchest.models import machine_of
from clutchest.reading.candidates import WHEEL
from clutchest.reading.gears import through_sent_gear
from clutchest.reading.inspection import inspect_logs
from clutchest.reading.table_inspection import inspect_tables
from clutchest.signals import Why
from clutchest.vehicle import dump_vehicle, load_vehicle

NAMES = {
    "engine_speed": (
        "EngSpeed",
        "Motordrehzahl",
        "nMot",
        "regime_moteur",
        "Regimen_Motor",
        "giri_motore",
        "Motorvarvtal",
        "obroty_silnika",
        "ENGINE_RPM",
    ),
    "input_shaft_speed": ("TrnInSpeed_InputSpeed", "Getriebeeingangsdrehzahl", "arbre_primaire"),
    "engine_torque": ("Motormoment", "couple_moteur", "par_motor", "EngineTorque"),
    "vehicle_speed": ("VehicleSpeed", "Geschwindigkeit", "vitesse", "Velocidad", "Hastighet"),
    "coolant_temp": ("CoolantTemp", "Kuehlmitteltemp", "temp_eau", "Temp_Refrigerante"),
    "ambient_temp": ("AmbientTemp", "Aussentemp", "Temp_ext"),
}


@pytest.mark.parametrize(("canonical", "names"), NAMES.items())
def test_names_in_several_languages(canonical: str, names: tuple[str, ...]) -> None:
    pattern = machine_of("dry_clutch").column(canonical).named
    for name in names:
        assert re.search(pattern, name, re.IGNORECASE), name


def test_names_of_wheels() -> None:
    for name in ("WheelSpeedRL", "WHL_SPD_FR", "Raddrehzahl_HL", "WhlRl_W_Meas", "vitesse_roue"):
        assert WHEEL.search(name), name
    for name in ("EngineSpeed", "Veh_V_ActlEng", "SteeringWheelAngle"):
        assert not WHEEL.search(name), name


DBC = """VERSION ""
NS_ :
BS_:
BU_: A B
BO_ 320 M1: 8 A
 SG_ S1 : 0|16@1+ (0.25,0) [0|8000] "rpm" B
 SG_ S2 : 16|16@1+ (0.25,0) [0|8000] "rpm" B
 SG_ EngineSpeedTarget : 32|16@1+ (0.25,0) [0|8000] "rpm" B
 SG_ Gear : 48|8@1+ (1,0) [0|15] "" B
BO_ 212 M2: 8 A
 SG_ WheelSpeedRL : 0|16@1+ (0.01,0) [0|300] "km/h" B
 SG_ WheelSpeedRR : 16|16@1+ (0.01,0) [0|300] "km/h" B
"""
RATIOS = np.array([13.0, 8.0, 5.0])
T = np.arange(0.0, 45.0, 0.02)


def speeds() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Engine, shaft, wheel (rad/s) and gear: three gears of 15 s, each begun with 1 s of slip."""
    gear = (T // 15).astype(int)
    wheel = np.interp(T, [0, 1, 15, 30, 45], [0, 8, 22, 30, 44]) * (1 + 0.05 * np.sin(T / 2))
    shaft = wheel * RATIOS[gear]
    engine = shaft + np.where(T % 15 < 1.0, 60.0 * (1.0 - T % 15), 0.0)
    return engine, shaft, wheel, gear + 1


def log(folder: Path, target: str, numbers: tuple[int, ...] = (1, 2, 3)) -> Path:
    """A log and its DBC, in which the third speed, always 900 rpm, is called ``target``; the gears
    are sent as ``numbers``."""
    engine, shaft, wheel, gear = speeds()
    gear = np.array(numbers)[gear - 1]
    (folder / "car.dbc").write_text(DBC.replace("EngineSpeedTarget", target))
    bus = load([folder / "car.dbc"])
    t = np.round(T * 1e9).astype(np.int64) + 1_700_000_000 * 10**9
    rpm, kmh = 30 / np.pi, 3.6 * 0.3
    one = {"S1": engine * rpm, "S2": shaft * rpm, target: np.full(len(T), 900.0), "Gear": gear}
    two = {"WheelSpeedRL": wheel * kmh * 0.99, "WheelSpeedRR": wheel * kmh * 1.01}
    first = encode(bus.message("M1"), one, t)
    second = encode(bus.message("M2"), two, t + 10**6)
    write_frames(Frames.concatenate([first, second]).sorted(), folder / "a.log")
    return folder / "a.log"


def test_speeds_without_a_name_are_known_by_what_they_turn_with(tmp_path: Path) -> None:
    found = inspect_logs([log(tmp_path, "S3")], [tmp_path / "car.dbc"], model="dry_clutch")
    engine, shaft = (found.candidates[n][0] for n in ("engine_speed", "input_shaft_speed"))
    assert (engine.by, shaft.by) == ("behaviour", "behaviour")
    assert (engine.signal, shaft.signal) == ("S1", "S2")


def test_what_is_missing_may_be_in_percent(tmp_path: Path) -> None:
    """No log says what 100 % of a stroke is; that it is there in percent, the draft says."""
    path = log(tmp_path, "Travel")
    dbc = (tmp_path / "car.dbc").read_text()
    travel = dbc.replace('Gear : 48|8@1+ (1,0) [0|15] ""', 'Travel2 : 48|8@1+ (1,0) [0|100] "%"')
    (tmp_path / "car.dbc").write_text(travel)
    found = inspect_logs([path], [tmp_path / "car.dbc"], model="dry_clutch")
    (words,) = (words for words in found.missing if words.startswith("signals.slave_position"))
    assert "in %: M1.Travel2, which 'reference'" in words
    table = pd.DataFrame({"time": T, "engine_speed": speeds()[0], "Stroke [%]": 50.0 + T})
    table.to_csv(tmp_path / "a.csv", index=False)
    (words,) = (w for w in inspect_tables([tmp_path / "a.csv"]).missing if "slave_position" in w)
    assert "in %: Stroke [%], which 'reference'" in words


def test_what_is_missing_may_have_a_name_of_its_own(tmp_path: Path) -> None:
    """A stroke in mm under a name that nobody knows is no candidate, but the draft shows it."""
    path = log(tmp_path, "Travel")
    dbc = (tmp_path / "car.dbc").read_text()
    (tmp_path / "car.dbc").write_text(
        dbc.replace('Gear : 48|8@1+ (1,0) [0|15] ""', 'KUsN : 48|8@1+ (10,0) [0|0] "um"')
    )
    found = inspect_logs([path], [tmp_path / "car.dbc"], model="dry_clutch")
    (words,) = (words for words in found.missing if words.startswith("signals.slave_position"))
    assert words.endswith("no signal has a matching SPN or name; in such a unit: M1.KUsN")


def test_a_setpoint_comes_after_what_is_measured(tmp_path: Path) -> None:
    path = log(tmp_path, "EngineSpeedTarget")
    (tmp_path / "car.dbc").write_text((tmp_path / "car.dbc").read_text().replace("S1", "EngineRpm"))
    found = inspect_logs([path], [tmp_path / "car.dbc"], model="dry_clutch")
    names = [c.signal for c in found.candidates["engine_speed"]]
    assert names == ["EngineRpm", "EngineSpeedTarget"]
    assert not found.candidates["engine_speed"][1].lively


@pytest.mark.parametrize("numbers", [(1, 2, 3), (1, 2, 4)], ids=["1 2 3", "one is skipped"])
def test_a_draft_by_wheels_and_the_sent_gear_replays_as_the_truth(
    numbers: tuple[int, ...], tmp_path: Path
) -> None:
    path = log(tmp_path, "EngineSpeedTarget", numbers)
    text = (tmp_path / "car.dbc").read_text()
    text = text.replace("S1", "EngineRpm").replace(
        ' SG_ S2 : 16|16@1+ (0.25,0) [0|8000] "rpm" B\n', ""
    )
    (tmp_path / "car.dbc").write_text(text)
    found = inspect_logs([path], [tmp_path / "car.dbc"], model="dry_clutch")
    line = found.draft.driveline
    assert (line.wheel.layout.name, line.other.layout.name) == ("WheelSpeedRL", "WheelSpeedRR")
    assert line.gear.numbers == numbers
    assert line.gear.counts_from_one == (numbers == (1, 2, 3))
    radius = 0.32  # the guess; the ratios are relative to it
    assert [g.ratio for g in line.gears] == pytest.approx(RATIOS * radius / 0.3, rel=0.01)
    found.write_vehicle(tmp_path / "v.toml", tmp_path / "v.toml")
    vehicle = load_vehicle(tmp_path / "v.toml")
    assert vehicle.modes["longest_engagement"] == 3.0
    signals = clutchest.read_log(path, vehicle)
    _, shaft, _, _ = speeds()
    assert signals["input_shaft_speed"].value == pytest.approx(shaft, rel=0.01, abs=1.0)
    run = clutchest.replay(signals, vehicle)
    assert run.summary["modes_s"]["slipping"] == pytest.approx(3.0, abs=0.8)
    assert [event["gear"] for event in run.summary["engagements"]] == list(numbers)
    dump_vehicle(vehicle, tmp_path / "again.toml")
    assert load_vehicle(tmp_path / "again.toml").signals == vehicle.signals


def test_a_gear_without_a_ratio_gives_no_shaft_speed() -> None:
    gear = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 7.0, np.nan])
    speed, why = through_sent_gear(np.full(7, 10.0), np.zeros(7, np.uint8), gear, RATIOS, (1, 2, 4))
    known = why == Why.VALID
    assert known.tolist() == [False, True, True, False, True, False, False]
    assert speed[known].tolist() == [130.0, 80.0, 50.0]
