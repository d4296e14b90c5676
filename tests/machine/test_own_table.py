"""A machine of one's own, and the table of a logger of one's own: signals at different rates."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import clutchest
from clutchest.reading import read_log
from clutchest.reading.table_inspection import inspect_tables
from clutchest.simulated import simulate_sampled, write_simulation
from clutchest.vehicle import Vehicle, load_vehicle

SERVO = Path(__file__).parents[2] / "machines" / "servo"
COLUMNS = """
name = "servo"
model = "servo.py"

[columns]
voltage = { column = "U", unit = "V", noise = 0.02, period = 0.01 }
current = { column = "I", unit = "A", noise = 0.05, period = 0.01 }
speed = { column = "n", unit = "rpm", noise = 0.5, period = 0.01 }
ambient_temp = { column = "air", unit = "°C", noise = 0.3, period = 1.0 }

[parameters]
"""


@pytest.fixture
def rig(tmp_path) -> Vehicle:
    """The servo as a table has it, its air once a second."""
    known = (SERVO / "servo.toml").read_text(encoding="utf-8")
    (tmp_path / "servo.py").write_bytes((SERVO / "servo.py").read_bytes())
    text = COLUMNS + known[known.index("[parameters]\n") + len("[parameters]\n") :]
    (tmp_path / "rig.toml").write_text(text, encoding="utf-8")
    return load_vehicle(tmp_path / "rig.toml", trust=True)


def edited(rig: Vehicle, file: str, old: str, new: str) -> Vehicle:
    """The rig with a line of one of its files changed."""
    path = rig.path.with_name(file)
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")
    return load_vehicle(rig.path, trust=True)


def test_an_input_may_set_the_pace(rig, tmp_path):
    """An anchor that no sensor reads: no state starts from it."""
    write_simulation(tmp_path / "drive.csv", rig, "mixed", 1, duration=5.0)
    by_input = edited(rig, "servo.py", 'anchor="speed"', 'anchor="voltage"')
    runs = [clutchest.replay(read_log(tmp_path / "drive.csv", car), car) for car in (rig, by_input)]
    own, other = (run["speed"].value[-10:] for run in runs)
    np.testing.assert_allclose(other, own, atol=1.0)


def test_a_table_is_simulated_with_each_signal_at_its_own_rate(rig, tmp_path):
    """Those of one period have their samples in common rows, the others in rows between."""
    write_simulation(tmp_path / "drive.csv", rig, "mixed", 1, duration=10.0)
    table = pd.read_csv(tmp_path / "drive.csv")
    count = table.count()
    assert count["U"] == count["I"] == count["n"] and 995 <= count["U"] <= 1001
    assert 9 <= count["air"] <= 11
    assert len(table) in (count["U"] + count["air"], count["U"])
    read, made = read_log(tmp_path / "drive.csv", rig), simulate_sampled(rig, "mixed", 1)
    time, value = made.signals["ambient_temp"]
    seen = time < 9.0
    count = seen.sum()
    np.testing.assert_allclose(read["ambient_temp"].value[:count], value[seen], atol=1e-9)
    apart = np.diff(read["ambient_temp"].time)
    assert np.median(apart) == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize(
    ("swing", "gap", "warned"), [(5.0, 0.5, True), (5.0, 90.0, False), (0.0, 0.5, False)]
)
def test_an_input_that_is_held_though_it_moves_is_named(rig, tmp_path, swing, gap, warned):
    """A slow input holds its last value; what moves by more than its noise is then late."""
    car = edited(rig, "rig.toml", "[parameters]", f"[modes]\ngap = {gap}\n\n[parameters]")
    write_simulation(tmp_path / "drive.csv", car, "mixed", 1, duration=20.0)
    table = pd.read_csv(tmp_path / "drive.csv")
    table["air"] += swing * np.sin(table["time"])
    table.to_csv(tmp_path / "drive.csv", index=False)
    run = clutchest.replay(read_log(tmp_path / "drive.csv", car), car)
    words = [w for w in run.warnings if w.startswith("ambient_temp: changes by")]
    assert len(words) == warned
    assert all(
        "its gap of 60 s is longer than [modes] gap (0.5 s): it acts 0.5 s" in w for w in words
    )


@pytest.mark.parametrize("doubled", [False, True])
def test_a_column_is_drafted_by_its_unit_where_it_is_the_only_one(rig, tmp_path, doubled):
    """Names on a logger are the user's own; of two temperatures the draft names both."""
    write_simulation(tmp_path / "drive.csv", rig, "mixed", 1, duration=5.0)
    table = pd.read_csv(tmp_path / "drive.csv").rename(
        columns={"U": "U_KL [V]", "I": "I_Mot [A]", "n": "nMot [1/min]", "air": "T_Luft [°C]"}
    )
    if doubled:
        table["T_Raum [°C]"] = table["T_Luft [°C]"]
    table.to_csv(tmp_path / "drive.csv", index=False)
    found = inspect_tables([tmp_path / "drive.csv"], str(tmp_path / "servo.py"))
    drafted = {name: columns[0].column for name, columns in found.candidates.items()}
    assert drafted.pop("ambient_temp", None) == (None if doubled else "T_Luft [°C]")
    assert drafted == {"voltage": "U_KL [V]", "current": "I_Mot [A]", "speed": "nMot [1/min]"}
    assert not [w for w in found.missing if w.startswith("columns.")]


def test_columns_in_a_fitting_unit_are_named_where_they_are_several(rig, tmp_path):
    write_simulation(tmp_path / "drive.csv", rig, "mixed", 1, duration=5.0)
    table = pd.read_csv(tmp_path / "drive.csv").rename(columns={"U": "U_a [V]", "I": "I [A]"})
    table["U_b [V]"] = table["U_a [V]"]
    table.to_csv(tmp_path / "drive.csv", index=False)
    found = inspect_tables([tmp_path / "drive.csv"], str(tmp_path / "servo.py"))
    words = (
        "columns.voltage (V): no column has a matching name and unit; in such a unit: U_a [V], U_b"
    )
    assert any(missing.startswith(words) for missing in found.missing)


@pytest.mark.parametrize(("longest", "warned"), [(0.001, False), (0.008, True)])
def test_steps_that_are_too_long_are_named(rig, tmp_path, longest, warned):
    """What their integration is off by would pass for an error of the equations."""
    write_simulation(tmp_path / "drive.csv", rig, "mixed", 1, duration=20.0)
    car = edited(rig, "servo.py", "longest=(0.001, 0.001)", f"longest=({longest}, {longest})")
    found = clutchest.discover(read_log(tmp_path / "drive.csv", car), car)
    assert any("steps (Model.longest) are too long" in w for w in found.warnings) == warned
