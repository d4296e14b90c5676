"""How results show themselves in a terminal and in a notebook."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest

import clutchest
from clutchest.errors import ClutchestError
from clutchest.estimate.run import Run
from clutchest.record.files import json_text
from clutchest.shown import Shown, plus_minus, printed
from clutchest.units import parse

PNG = b"\x89PNG"


@pytest.fixture(scope="module")
def run() -> Run:
    return clutchest.replay("demo", "truck")


def test_a_result_is_one_line(run: Run) -> None:
    track, signal = run.tracks[0], run.signals["engine_speed"]
    parts = (track, track.states["friction"], track.innovations, run["friction"], signal)
    for result in (run, run.signals, run.vehicle, clutchest.diagnose(run), *parts):
        assert "\n" not in repr(result)
        assert len(repr(result)) < 200


def test_results_are_equal_where_their_numbers_are(run: Run) -> None:
    again, other = clutchest.replay("demo", "truck"), clutchest.replay("demo", "truck", rate=5.0)
    for parts in (
        lambda r: r,
        lambda r: r.tracks[0],
        lambda r: r["friction"],
        lambda r: r.tracks[0].states["friction"],
    ):
        assert parts(run) == parts(again)
        assert parts(run) != parts(other) and parts(run) != 3
    assert clutchest.diagnose(run) == clutchest.diagnose(again)
    assert pickle.loads(pickle.dumps(run)) == run


def test_signals_are_equal_where_their_samples_are() -> None:
    drives = [clutchest.simulate("truck", "city", seed=seed, duration=5) for seed in (1, 1, 2)]
    assert drives[0] == drives[1] != drives[2]
    assert drives[0]["engine_speed"] == drives[1]["engine_speed"] != drives[2]["engine_speed"]
    missing = clutchest.Signal.of("x", "", [0.0, 1.0], [np.nan, 1.0])
    assert missing == clutchest.Signal.of("x", "", [0.0, 1.0], [np.nan, 1.0])


def test_a_table_has_a_row_for_each_state(run: Run) -> None:
    rows = [name for name, *_ in run.shown().rows]
    assert rows == list(run.tracks[0].states)
    assert run._repr_html_().count("<tr>") == len(rows) + 1


def test_a_vehicle_shows_its_parameters() -> None:
    truck = clutchest.load_vehicle("truck").with_parameters(engine_inertia=4.0)
    assert repr(truck).startswith("<Vehicle: truck, dry_clutch, 8 signals, ")
    (row,) = [row for row in truck.shown().rows if row[0] == "engine_inertia"]
    assert row[1:] == ("4", "kg m²", "0.096", "given instead of 3.2")
    assert truck._repr_html_().count("<tr>") == len(truck.parameters) + 1


def test_html_is_escaped() -> None:
    assert "<b>" not in Shown("<b>", ("<b>",), [("<b>",)]).html


def test_pictures_of_signals_and_runs(run: Run) -> None:
    assert run.signals.plot("engine_speed", "slave_position")._repr_png_().startswith(PNG)
    picture = run.plot()
    assert picture._repr_png_().startswith(PNG)
    mode, first, *_ = picture.axes
    assert [label.get_text() for label in mode.get_yticklabels()] == list(
        np.array(run.tracks[0].mode_names)[np.unique(run.tracks[0].mode)]
    )
    assert first.get_title(loc="left") == "body temperature [°C]"
    _, *some = run.plot("friction", "clutch_torque", drive=0).axes
    assert [axes.get_title(loc="left") for axes in some] == ["friction", "clutch torque [Nm]"]


def test_pictures_of_what_is_not_there(run: Run) -> None:
    with pytest.raises(ClutchestError, match=r"no signal 'engine_sped'.*engine_speed"):
        run.signals.plot("engine_sped")
    with pytest.raises(ClutchestError, match="no drive 3, expected 0"):
        run.plot(drive=3)
    with pytest.raises(ClutchestError, match=r"no estimate 'frictio'; did you mean 'friction'"):
        run.plot("frictio")
    with pytest.raises(ClutchestError, match=r"no estimate 'temp_disk'; did you mean 'temp_disc'"):
        run.plot("temp_disk")
    with pytest.raises(ClutchestError, match=r"signal: run\.signals\.plot\('slave_position'\)"):
        run.plot("friction", "slave_position")
    with pytest.raises(ClutchestError, match=r"no estimate '1'; a drive is given as drive=1"):
        run.plot(1)
    with pytest.raises(ClutchestError, match="drive: expected a whole number, not 'friction'"):
        run.plot(drive="friction")


def test_a_diagnosis_draws_every_monitor_that_ran(run: Run) -> None:
    diagnosis = clutchest.diagnose(run)
    (axes,) = diagnosis.plot().axes
    ran = [name for name, drives in diagnosis.lanes.items() if drives[0]]
    assert [label.get_text() for label in axes.get_yticklabels()] == ran
    with pytest.raises(ClutchestError, match="drive: expected a whole number, not 'stuck'"):
        diagnosis.plot("stuck")


def test_columns_have_units(run: Run) -> None:
    units = run.to_pandas().attrs["units"]
    assert units["temp_disc"] == units["temp_disc_std"] == "°C"
    assert units["clutch_torque"] == "Nm"
    assert "mode" not in units


def test_other_parameters() -> None:
    truck = clutchest.load_vehicle("truck")
    other = truck.with_parameters(engine_inertia=4.0)
    assert other.parameters["engine_inertia"].value == 4.0
    assert other.parameters["engine_inertia"].spread == truck.parameters["engine_inertia"].spread
    assert other.hash != truck.hash
    with pytest.raises(ClutchestError, match=r"no parameter 'engine_inerta'; .*engine_inertia"):
        truck.with_parameters(engine_inerta=4.0)
    with pytest.raises(ClutchestError, match="no finite number"):
        truck.with_parameters(engine_inertia=float("nan"))


@pytest.mark.slow
def test_logs_and_vehicles_by_name(run: Run) -> None:
    """Wherever a log or a vehicle is meant, its name will do."""
    by_name, known = clutchest.diagnose("demo", "truck"), clutchest.diagnose(run)
    assert json_text(by_name.summary()) == json_text(known.summary())
    with pytest.raises(ClutchestError, match="no vehicle"):
        clutchest.diagnose("demo")
    with pytest.raises(ClutchestError, match="has its vehicle"):
        clutchest.diagnose(run, "truck")


@pytest.mark.slow
def test_identify_and_discover_by_name() -> None:
    fit = clutchest.identify_vehicle("noise", "demo", "truck")
    assert fit.vehicle.name == "truck"
    found = clutchest.discover("demo", "truck")
    assert found.plot()._repr_png_().startswith(PNG)


def test_powers_of_units_are_raised():
    assert printed("Nm/mm^3") == "Nm/mm³" and printed("kg m^-2") == "kg m⁻²"
    assert plus_minus(1.5, 0.1, "kg m^2") == "1.50 ± 0.10 kg m²" and printed("°C") == "°C"


@pytest.mark.parametrize(
    ("unit", "read"),
    [
        ("1/(100 K)", "per 100 K"),
        ("1/mm", "per mm"),
        ("s/(100 rad)", "per 100 rad/s"),
        ("Nm s/(100 rad)", "Nm per 100 rad/s"),
        ("s/(20 m)", "per 20 m/s"),
        ("s^2/(100 rad)^2", "per (100 rad/s)²"),
        ("W/(m K)", "W/(m K)"),
        ("mm/s", "mm/s"),
    ],
)
def test_units_are_printed_as_people_say_them(unit: str, read: str) -> None:
    parse(unit)
    assert printed(unit) == read


def test_a_value_has_the_digits_that_its_uncertainty_supports() -> None:
    assert plus_minus(40512.3, 1634.2) == "40512 ± 1634"
    assert plus_minus(-0.0001, 0.39) == "0.00 ± 0.39"
    assert plus_minus(4.5e8, 7e6, "N/m") == "4.5e+08 ± 7e+06 N/m"
    assert plus_minus(1.234e-8, 2e-10) == "1.234e-08 ± 2e-10"
    assert plus_minus(0.03970837, 1.4e-6, "V s") == "0.0397084 ± 1.4e-06 V s"
    assert plus_minus(123456789.0, 12.0) == "123456789 ± 12"
    assert plus_minus(0.0, 2e-9) == "0 ± 2e-09" and plus_minus(4e6, 0.0) == "4e+06 ± 0"


@pytest.mark.slow
def test_diagnoses_and_fits_are_tables_too(run: Run) -> None:
    monitors = clutchest.diagnose(run).to_pandas()
    assert set(monitors["status"]) <= {"passed", "failed", "not run"}
    assert monitors.attrs["units"]["first_detected_s"] == "s"
    fit = clutchest.identify_vehicle("noise", "demo", "truck")
    table = fit.to_pandas().set_index("name")
    assert list(table.index) == list(fit.parameters)
    for name, fitted in fit.parameters.items():
        assert (table.loc[name, "value"], table.loc[name, "unit"]) == (fitted.value, fitted.unit)


def test_a_run_is_written_into_a_folder_by_name(run: Run, tmp_path: Path) -> None:
    assert tmp_path / "out" / "summary.json" in clutchest.write_run(run, str(tmp_path / "out"))
