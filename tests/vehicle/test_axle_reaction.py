"""The torque of a differential from two half-shafts, or from the tyres' longitudinal forces."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import clutchest
from clutchest.errors import ClutchestError
from clutchest.simulated import simulate_sampled, write_simulation
from clutchest.vehicle import dump_vehicle, load_vehicle

FORCES = """VERSION ""
NS_ :
BS_:
BU_: Chassis
BO_ 450 Wheel_Forces: 8 Chassis
 SG_ ForceLeft : 0|16@1- (1,0) [-32000|32000] "N" Vector__XXX
 SG_ ForceRight : 16|16@1- (1,0) [-32000|32000] "N" Vector__XXX
"""
SHAFT = """[signals.shaft_torque]
message = "Wheel_Forces"
signal = "ForceLeft"
less = { signal = "ForceRight" }
unit = "N"
radius = { value = 320, unit = "mm" }
noise = 40.0
period = 0.01
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """The car, whose axle's reaction is measured instead of its half-shafts."""
    stock = load_vehicle("alsd_car")
    text = stock.path.read_text(encoding="utf-8").replace(
        '"alsd.dbc"]', '"alsd.dbc", "forces.dbc"]'
    )
    before, _, rest = text.partition("[signals.shaft_torque]")
    text = before + SHAFT + "\n[" + rest.partition("\n[")[2]
    (tmp_path / "forces.dbc").write_text(FORCES)
    path = tmp_path / "forces.toml"
    path.write_text(text.replace(', "Half_Shafts"', ""))
    return path


def test_the_difference_of_the_tyres_forces_is_the_torque(file, tmp_path):
    car = load_vehicle(file)
    assert "Half_Shafts" not in file.read_text()
    _, true = simulate_sampled(car, "car", 3, duration=10.0).signals["shaft_torque"]
    torque = clutchest.simulate(car, "car", 3, duration=10.0)["shaft_torque"]
    np.testing.assert_allclose(torque.value, true, atol=2 * 0.32)
    assert np.ptp(torque.value) > 300.0
    dump_vehicle(car, tmp_path / "again.toml")
    assert load_vehicle(tmp_path / "again.toml").signals == car.signals


def test_two_half_shafts_need_no_radius(file):
    text = file.read_text().replace('radius = { value = 320, unit = "mm" }\n', "")
    (file.parent / "forces.dbc").write_text(FORCES.replace('"N"', '"Nm"'))
    file.write_text(text.replace('unit = "N"\n', 'unit = "Nm"\n'))
    car = load_vehicle(file)
    _, true = simulate_sampled(car, "car", 3, duration=5.0).signals["shaft_torque"]
    torque = clutchest.simulate(car, "car", 3, duration=5.0)["shaft_torque"]
    np.testing.assert_allclose(torque.value, true, atol=2.0)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('unit = "N"\n', 'unit = "rpm"\n', "cannot be converted"),
        ('radius = { value = 320, unit = "mm" }\n', "", "cannot be converted"),
        ('less = { signal = "ForceRight" }', "less = { message = 'Wheel_Forces' }", "no 'signal'"),
        ("noise = 40.0\n", "noise = 40.0\nreference = { value = 9, unit = 'Nm' }\n", "percent"),
    ],
)
def test_what_makes_no_torque_is_said(file, old, new, words):
    text = file.read_text()
    assert old in text
    head, _, tail = text.partition("[signals.shaft_torque]")
    file.write_text(head + "[signals.shaft_torque]" + tail.replace(old, new, 1))
    with pytest.raises(ClutchestError, match=rf"forces\.toml:\d+: .*{words}"):
        load_vehicle(file)


def test_a_difference_is_of_torques_only(file):
    text = file.read_text()
    entry = "[signals.oil_temp]\n"
    file.write_text(text.replace(entry, entry + 'less = { signal = "ArmatureTemperature" }\n'))
    with pytest.raises(ClutchestError, match="'less' is for a torque"):
        load_vehicle(file)


def test_without_the_other_side_there_is_no_torque(file, tmp_path):
    dbc = file.parent / "forces.dbc"
    dbc.write_text(
        FORCES.replace(" SG_ ForceRight", "BO_ 451 Right_Forces: 8 Chassis\n SG_ ForceRight")
    )
    file.write_text(file.read_text().replace("less = {", 'less = { message = "Right_Forces",'))
    log = tmp_path / "drive.log"
    write_simulation(log, load_vehicle(file), "car", 3, duration=5.0)
    assert clutchest.read_log(log, file)["shaft_torque"].valid.all()
    lines = [line for line in log.read_text().splitlines() if " 1C3#" not in line]
    log.write_text("\n".join(lines) + "\n")
    signals = clutchest.read_log(log, file)
    assert "shaft_torque" not in signals.available
    assert any("no valid Right_Forces.ForceRight" in words for words in signals.warnings)


def test_a_side_that_falls_silent_is_no_torque_soon_after(file, tmp_path):
    dbc = file.parent / "forces.dbc"
    message = "BO_ 451 Right_Forces: 8 Chassis\n SG_ ForceRight"
    dbc.write_text(FORCES.replace(" SG_ ForceRight", message))
    file.write_text(file.read_text().replace("less = {", 'less = { message = "Right_Forces",'))
    log = tmp_path / "drive.log"
    write_simulation(log, load_vehicle(file), "car", 3, duration=5.0)
    lines = log.read_text().splitlines()
    kept = [line for k, line in enumerate(lines) if " 1C3#" not in line or k < len(lines) / 2]
    log.write_text("\n".join(kept) + "\n")
    torque = clutchest.read_log(log, file)["shaft_torque"]
    assert torque.valid[torque.time < 2.5].all()
    assert not torque.valid[torque.time > 3.1].any()
