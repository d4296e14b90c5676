"""Wheel speeds in km/h, the usual unit on a bus, become a shaft speed by tyre radius and gears."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import clutchest
from clutchest.errors import ClutchestError
from clutchest.reading.inspection import inspect_logs
from clutchest.simulated import simulate_sampled, write_simulation
from clutchest.vehicle import dump_vehicle, load_vehicle

DBC = """VERSION ""
NS_ :
BS_:
BU_: ECM ABS
BO_ 320 Engine: 8 ECM
 SG_ EngineSpeed : 0|16@1+ (0.125,0) [0|8000] "rpm" ABS
 SG_ EngineTorque : 16|16@1+ (0.5,-5000) [-5000|5000] "Nm" ABS
BO_ 212 Wheels: 8 ABS
 SG_ WheelSpeedRL : 0|16@1+ (0.001,0) [0|65] "km/h" ECM
 SG_ WheelSpeedRR : 16|16@1+ (0.001,0) [0|65] "km/h" ECM
"""
SIGNALS = """
[signals.engine_speed]
message = "Engine"
signal = "EngineSpeed"
unit = "rpm"
noise = 0.06
period = 0.01

[signals.engine_torque]
message = "Engine"
signal = "EngineTorque"
unit = "Nm"
noise = 5.0
period = 0.01

[signals.input_shaft_speed]
message = "Wheels"
signal = "WheelSpeedRL"
unit = "km/h"
other = { signal = "WheelSpeedRR" }
gears = [12.0]
radius = { value = 310, unit = "mm" }
noise = 0.06
period = 0.01
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    parameters = load_vehicle("truck").path.read_text(encoding="utf-8").partition("[parameters]")[2]
    (tmp_path / "car.dbc").write_text(DBC)
    head = 'name = "car"\nmodel = "dry_clutch"\ndbc = ["car.dbc"]\n'
    (tmp_path / "car.toml").write_text(head + SIGNALS + "\n[parameters]" + parameters)
    return tmp_path / "car.toml"


def test_a_wheel_speed_in_kmh_is_a_shaft_speed(file, tmp_path):
    car = load_vehicle(file)
    assert car.signals["input_shaft_speed"].radius == pytest.approx(0.31)
    _, value = simulate_sampled(car, "launches", 1, duration=20.0).signals["input_shaft_speed"]
    shaft = clutchest.simulate(car, "launches", 1, duration=20.0)["input_shaft_speed"]
    step = 0.001 / 3.6 / 0.31 * 12.0
    moving = value > 0.0  # the bus has no negative speeds
    np.testing.assert_allclose(shaft.value[moving], value[moving], atol=step)
    assert value.max() > 50.0
    dump_vehicle(car, tmp_path / "again.toml")
    assert load_vehicle(tmp_path / "again.toml").signals == car.signals


def test_without_a_radius_it_says_what_is_missing(file):
    text = file.read_text().replace('radius = { value = 310, unit = "mm" }\n', "")
    file.write_text(text)
    with pytest.raises(ClutchestError, match=r"car\.toml:\d+: .*in km/h; with 'radius'"):
        load_vehicle(file)
    file.write_text(text.replace("gears = [12.0]", "radius = 0.3").replace("other =", "# "))
    with pytest.raises(ClutchestError, match="radius requires 'gears'"):
        load_vehicle(file)


def test_inspect_names_it_and_drafts_a_path_that_holds(file, tmp_path, monkeypatch):
    write_simulation(tmp_path / "a.log", load_vehicle(file), "launches", 1, duration=5.0)
    monkeypatch.chdir(tmp_path)
    found = inspect_logs(["a.log"], [Path("car.dbc")])
    assert found.wheels == ("Wheels.WheelSpeedRL (km/h)", "Wheels.WheelSpeedRR (km/h)")
    assert any("radius" in words and "WheelSpeedRL (km/h)" in words for words in found.missing)
    (tmp_path / "first").mkdir()
    found.write_vehicle(tmp_path / "first" / "v.toml", tmp_path / "first" / "v.toml")
    assert 'dbc = ["../car.dbc"]' in (tmp_path / "first" / "v.toml").read_text()


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        ("[1, 2]", "gear_numbers must be a list with a number for each of 'gears'"),
        ("[1, 4, 2]", "gear_numbers must rise from the first gear to the last"),
        ("[1, 2, 300]", "gear_numbers must be an integer 0 … 255, not 300"),
    ],
)
def test_gear_numbers_that_cannot_be_are_refused(numbers, message, file):
    gears = f'gears = [12.0, 8.0, 5.0]\ngear = {{ signal = "Gear" }}\ngear_numbers = {numbers}'
    file.write_text(file.read_text().replace("gears = [12.0]", gears))
    with pytest.raises(ClutchestError, match=rf"car\.toml:\d+: signals\.\w+\.{message}"):
        load_vehicle(file)
