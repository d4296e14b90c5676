"""Tables of a test rig: names, units and a clock of its own."""

from __future__ import annotations

import numpy as np
import pytest

import clutchest
from clutchest.errors import ClutchestError
from clutchest.reading import read_log
from clutchest.reading.table_inspection import inspect_tables

COLUMNS = {  # header → canonical name
    "U_Motor [V]": "armature_voltage",
    "I_Motor [mA]": "armature_current",
    "phi_Motor [Grad]": "motor_angle",
    "n_Diff [1/min]": "slip_speed",
    "T_Oel [°C]": "oil_temp",
    "T_Wicklung [°C]": "armature_temp",
    "M_Kupplung [Nmm]": "clutch_torque",
    "M_Motor [Nmm]": "motor_torque",
    "M_Antrieb [Nm]": "drive_torque",
    "phi_Antrieb [Grad]": "drive_angle",
}


def written(path, columns, clock="Uhrzeit"):
    rows = [f"# rig 4\n{';'.join([clock, *columns])}"]
    for k in range(200):
        numbers = [f"{40.0 + 0.1 * k:.1f}".replace(".", ",")] * len(columns)
        rows.append(";".join([f"09:12:{30 + 0.01 * k:05.2f}".replace(".", ","), *numbers]))
    path.write_text("\n".join(rows), encoding="utf-8")
    return path


def test_a_rig_is_recognised_by_german_names(tmp_path):
    found = inspect_tables([written(tmp_path / "rig.csv", COLUMNS)])
    assert found.machine.name == "alsd"
    assert {c[0].column: name for name, c in found.candidates.items()} == COLUMNS
    assert found.duration_s == pytest.approx(1.99)
    assert any("I5 (motor_inertia" in words for words in found.origin)
    assert not any("positions" in words for words in found.origin)


def test_a_rig_is_recognised_by_the_paper_s_symbols(tmp_path):
    """A column without a unit is taken for the canonical one, which is said where there are
    others."""
    columns = {
        "u_a [V]": "armature_voltage",
        "i_a": "armature_current",
        "alpha_m1": "motor_angle",
        "omega_s [rpm]": "slip_speed",
        "theta_a": "armature_temp",
        "T_c": "clutch_torque",
        "T_m1 [Nm]": "motor_torque",
        "T_m2 [Nm]": "drive_torque",
        "alpha_m2 [deg]": "drive_angle",
    }
    found = inspect_tables([written(tmp_path / "rig.csv", columns)])
    assert found.machine.name == "alsd"
    assert {c[0].column: name for name, c in found.candidates.items()} == columns
    (words,) = (w for w in found.warnings if "no unit is stated" in w)
    assert "taken for granted: alpha_m1 (rad), T_c (Nm); `unit` under [columns]" in words
    short = {"ArmVolt": "armature_voltage", "ClTrq [Nm]": "clutch_torque", "slip": "slip_speed"}
    found = inspect_tables([written(tmp_path / "short.csv", short)], "alsd")
    assert {c[0].column: name for name, c in found.candidates.items()} == short


def test_an_angle_that_only_grows_shows_no_resolution(tmp_path):
    path = written(tmp_path / "rig.csv", COLUMNS)
    grows = next(c for c in inspect_tables([path]).columns if c.column == "phi_Antrieb [Grad]")
    assert grows.step is None
    path.write_text("time;phi_Antrieb\n" + "\n".join(f"{k};{k // 2}" for k in range(50)))
    (halting,) = inspect_tables([path], "alsd").columns
    assert halting.step == 1.0


def test_a_drafted_file_reads_the_rig_s_units(tmp_path):
    log = written(tmp_path / "rig.csv", COLUMNS)
    draft = tmp_path / "vehicle.toml"
    inspect_tables([log]).write_vehicle(draft, draft)
    signals = read_log(log, clutchest.load_vehicle(draft))
    first = {name: signals[name].value[0] for name in signals}
    assert first["clutch_torque"] == pytest.approx(0.040)
    assert first["armature_current"] == pytest.approx(0.040)
    assert first["motor_angle"] == pytest.approx(np.radians(40.0))
    assert first["slip_speed"] == pytest.approx(40.0 * 2.0 * np.pi / 60.0)


def test_a_unit_that_nothing_knows_is_not_taken_for_the_canonical_one(tmp_path):
    log = written(tmp_path / "rig.csv", ["armature_voltage", "motor_angle [dig]"], "time")
    with pytest.raises(ClutchestError, match=r"'motor_angle \[dig\]': unknown unit 'dig'.*'deg'"):
        read_log(log, clutchest.load_vehicle("alsd_rig"))


def test_a_request_in_a_table_is_read_though_no_vehicle_file_states_its_noise(tmp_path):
    """It is only compared with the torque; the shipped file maps none, as its bus has none."""
    columns = ["armature_voltage", "motor_angle", "torque_request", "shaft_torque"]
    read = read_log(written(tmp_path / "rig.csv", columns, "time"), "alsd_rig")
    assert "torque_request" in read and "shaft_torque" not in read
    (words,) = (w for w in read.warnings if "ignored" in w)
    assert "shaft_torque" in words


def test_a_table_without_times_says_how_they_may_be_named(tmp_path):
    with pytest.raises(ClutchestError, match=r"no column of times, expected .*uhrzeit.*datum"):
        inspect_tables([written(tmp_path / "rig.csv", COLUMNS, "Ticks")])


def test_signals_of_another_machine_are_said_to_be_its(tmp_path):
    rig, truck = clutchest.load_vehicle("alsd_rig"), clutchest.load_vehicle("truck")
    log = written(tmp_path / "rig.csv", ["armature_voltage", "motor_angle"], "Zeit")
    with pytest.raises(ClutchestError, match="those of machine 'alsd', as of vehicle alsd_rig"):
        read_log(log, truck)
    log = written(tmp_path / "own.csv", ["U", "alpha"], "Zeit")
    with pytest.raises(ClutchestError, match=r"columns: U, alpha; .*inspect own\.csv.*columns"):
        read_log(log, rig)
