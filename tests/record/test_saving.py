"""What a newcomer tries on a result: its names, its values by name, and `save`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import clutchest
from clutchest.errors import ClutchestError


@pytest.fixture(scope="module")
def run():
    return clutchest.replay("demo", "truck")


def names(paths):
    assert all(path.is_file() for path in paths)
    return [path.name for path in paths]


def test_estimates_by_name(run):
    assert set(run.states) < set(run) == set(run.estimated) and len(run) == len(list(run))
    disc = run["temp_disc"]
    assert (disc.name, disc.unit, len(disc)) == ("temp_disc", "°C", len(run.tracks[0].time))
    table = run.to_pandas()
    np.testing.assert_array_equal(disc.time, table["time"])
    np.testing.assert_array_equal(disc.value, table["temp_disc"])
    np.testing.assert_array_equal(disc.std, table["temp_disc_std"])
    assert {name: run[name].unit for name in run}.items() <= table.attrs["units"].items()
    assert len(run["wear_rate"].only_valid()) == run["wear_rate"].valid.sum() < len(disc)
    assert repr(disc).startswith("<EstimatedSeries: temp_disc, ")
    two = replace(run, tracks=run.tracks * 2)
    assert two.estimate("clutch_torque", drive=1).unit == "Nm" and "clutch_torque" in two


def test_parts_of_other_results_by_name(run):
    found = clutchest.diagnose(run)
    assert found["wear"].name == "wear" and "wear" in found and bool(found)
    assert list(found) == [monitor.name for monitor in found.monitors]
    with pytest.raises(ClutchestError, match="no 'waer' in this Diagnosis; did you mean 'wear'"):
        found["waer"]
    fit = clutchest.identify("noise", run.signals, run.vehicle)
    first = next(iter(fit.parameters))
    assert fit[first] is fit.parameters[first] and list(fit) == list(fit.parameters)


def test_a_name_that_is_none(run):
    assert "temp_disk" not in run and run.get("temp_disk") is None
    assert run.signals.get("rpm", 3) == 3
    with pytest.raises(ClutchestError, match="no estimate 'temp_disk'; did you mean 'temp_disc'"):
        run["temp_disk"]
    with pytest.raises(KeyError, match=r"^no signal 'rpm' in this log; valid: "):
        run.signals["rpm"]
    with pytest.raises(ClutchestError, match="no drive 3, expected 0"):
        run.estimate("temp_disc", drive=3)


def test_saved_as_the_verb_does(run, tmp_path):
    files = names(run.save(tmp_path / "run", formats=["csv"]))
    assert files == [
        "estimates.csv",
        "estimates.parquet",
        "recording.rrd",
        "state.json",
        "summary.json",
    ]
    (table,) = run.save(tmp_path / "disc.csv")
    assert list(pd.read_csv(table, nrows=1)) == list(run.to_pandas())
    found = names(clutchest.diagnose(run).save(tmp_path / "faults"))
    assert found == ["diagnosis.json", "recording.rrd", "report.html"]
    (table,) = run.signals.save(tmp_path / "new" / "drive.parquet")
    again = clutchest.read_log(table, "truck")
    np.testing.assert_array_equal(again["engine_speed"].value, run.signals["engine_speed"].value)


def test_a_vehicle_is_saved(run, tmp_path):
    heavy = run.vehicle.with_parameters(engine_inertia=4.0)
    (path,) = heavy.save(tmp_path / "heavy.toml")
    again = clutchest.load_vehicle(path)
    assert again == heavy and again.dbc[0].path == run.vehicle.dbc[0].path


def test_a_fit_is_saved_and_knows_what_was_before(run, tmp_path):
    fit = clutchest.identify("noise", run.signals, run.vehicle)
    assert fit.before == run.vehicle and list(fit.summary()["parameters"]) == list(fit.parameters)
    assert names(fit.save(tmp_path)) == ["fit.json", "noise.png", "report.html", "vehicle.toml"]
    assert clutchest.load_vehicle(tmp_path / "vehicle.toml").signals == fit.vehicle.signals


@pytest.mark.parametrize("name", ["x.rrd", "x.json", "x.html"])
def test_what_does_not_fit(run, tmp_path, name):
    with pytest.raises(ClutchestError, match=rf"{name}: expected a folder, or a table's file"):
        run.save(tmp_path / name)
    with pytest.raises(ClutchestError, match=r"a vehicle is written as \.toml"):
        run.vehicle.save(tmp_path / name)
    with pytest.raises(ClutchestError, match=r"decoded signals are written as .*\.mf4"):
        run.signals.save(tmp_path / name)
    (tmp_path / "x.csv").mkdir()
    with pytest.raises(ClutchestError, match="is a folder, expected a file"):
        run.save(tmp_path / "x.csv")
    with pytest.raises(ClutchestError, match=r"expected Signals, a Vehicle or a result .* not int"):
        clutchest.save(3, tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["x.csv"]


def test_the_home_folder_is_what_it_is_in_a_shell(tmp_path, monkeypatch):
    """Arrow wrote there and all else into a folder named ~."""
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.setenv("USERPROFILE", str(tmp_path / "home"))
    monkeypatch.chdir(tmp_path)
    run = clutchest.replay("demo", "truck")
    for paths in (run.save("~/out"), clutchest.write_run(run, "~/out"), run.save("~/a.csv")):
        assert all(path.is_file() and path.is_relative_to(tmp_path / "home") for path in paths)
    run.vehicle.save("~/mine.toml")
    run.signals.save("~/signals.csv")
    assert clutchest.read_log("~/signals.csv", "~/mine.toml").available == run.signals.available
    assert [path.name for path in tmp_path.iterdir()] == ["home"]
