"""The recording, read back with Rerun's own reader."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from rerun.chunk import RrdReader

import clutchest
from clutchest.errors import ClutchestError
from clutchest.estimate.run import Estimate
from clutchest.models import machine_of
from clutchest.record import series
from clutchest.record.blueprint import INVALID, MOST_PANELS, Panel, opening, panel
from clutchest.record.rerun import _informative, _overview, write_recording
from clutchest.record.series import outline

RPM = 60 / (2 * np.pi)


def read(path) -> tuple[dict[str, pd.DataFrame], dict[str, pd.DataFrame]]:
    """Entity → rows over time, and entity → static row."""
    moving: dict[str, list[pd.DataFrame]] = {}
    static: dict[str, list[pd.DataFrame]] = {}
    for chunk in RrdReader(path).stream().to_chunks():
        group = static if chunk.is_static else moving
        group.setdefault(chunk.entity_path, []).append(chunk.to_record_batch().to_pandas())
    tables = {
        name: pd.concat(parts).sort_values("time", kind="stable") for name, parts in moving.items()
    }
    return tables, {name: pd.concat(parts) for name, parts in static.items()}


def blueprint_of(path) -> dict[str, dict[str, list]]:
    """Blueprint entity → component → its cells."""
    reader = RrdReader(path)
    (store,) = reader.blueprints()
    tables: dict[str, dict[str, list]] = {}
    for chunk in reader.stream(store=store).to_chunks():
        tables.setdefault(chunk.entity_path, {}).update(chunk.to_record_batch().to_pydict())
    return tables


def column(table: pd.DataFrame, name: str) -> np.ndarray:
    return np.array([np.asarray(cell) for cell in table[name]]).squeeze(axis=1)


def seconds(table: pd.DataFrame) -> np.ndarray:
    return table["time"].to_numpy().astype("timedelta64[ns]").astype(np.int64) * 1e-9


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_a_full_disk_is_said_in_words(run):
    with pytest.raises(ClutchestError, match=r"^/dev/full: cannot be written"):
        write_recording(run, Path("/dev/full"))


@pytest.fixture(scope="module")
def path(run, tmp_path_factory):
    path = tmp_path_factory.mktemp("recording") / "recording.rrd"
    write_recording(run, path)
    return path


@pytest.fixture(scope="module")
def tables(path):
    return read(path)


def test_entities(run, tables):
    moving, static = tables
    expected = {f"/can/{name}" for name in run.signals}
    expected |= {f"/state/{state.name}" for state in machine_of("dry_clutch").states}
    expected |= {"/state/clutch_torque", "/state/slip_energy", "/mode"}
    expected |= {f"/residual/{name}" for name in run.tracks[0].innovations.names}
    assert set(moving) == expected
    assert "/report" in static


def test_states_are_those_of_the_run(run, tables):
    moving, _ = tables
    (track,) = run.tracks
    for name in ("temp_disc", "zero_position", "friction"):
        table, estimate = moving[f"/state/{name}"], track.states[name]
        np.testing.assert_allclose(seconds(table), track.time, atol=1e-9)
        np.testing.assert_array_equal(column(table, "Measurements:values"), estimate.value)
        variance = column(table, "Measurements:variances")
        np.testing.assert_allclose(variance, estimate.std**2, rtol=1e-12)


def test_estimates_that_are_not_valid_are_grey(run, tables):
    estimate = run.tracks[0].states["temp_disc"]
    colours = column(tables[0]["/state/temp_disc"], "Measurements:colors")
    assert 0 < np.sum(~estimate.valid) < len(colours)
    # the first row lends its colour to the legend
    np.testing.assert_array_equal((colours == INVALID)[1:], ~estimate.valid[1:])


def test_speeds_are_in_rpm_and_energy_in_kJ(run, tables):
    moving, _ = tables
    signal = run.signals["engine_speed"]
    shown = column(moving["/can/engine_speed"], "Scalars:scalars")
    np.testing.assert_allclose(shown, signal.value * RPM, rtol=1e-12)
    energy = column(moving["/state/slip_energy"], "Measurements:values")
    np.testing.assert_allclose(energy, run.tracks[0].slip_energy.value / 1e3, rtol=1e-12)


def test_residuals_with_their_bounds(run, tables):
    table = tables[0]["/residual/zero_position"]
    time, innovation, std = run.tracks[0].innovations.of("zero_position")
    assert len(table) == len(time)
    rows = np.array([np.asarray(cell) for cell in table["Scalars:scalars"]])
    np.testing.assert_allclose(rows, np.column_stack([innovation, 3 * std, -3 * std]), rtol=1e-12)


def test_mode_changes(run, tables):
    (track,) = run.tracks
    table = tables[0]["/mode"]
    states = column(table, "StateChange:state")
    # what the lane shows at each time of the track is the track's mode
    latest = np.searchsorted(seconds(table), track.time[:-1] + 1e-6) - 1
    shown = states[latest]
    np.testing.assert_array_equal(shown, np.array(track.mode_names)[track.mode[:-1]])
    assert len(table) == 2 + np.count_nonzero(np.diff(track.mode))


def test_properties_and_report(run, tables):
    _, static = tables
    made_by = static["/__properties/provenance"]
    for key, value in run.provenance.items():
        assert made_by[key].iloc[0][0] == value
    text = static["/report"]["TextDocument:text"].iloc[0][0]
    assert "52.0 ± 1.8 kJ" in text
    assert "parameter 'kiss_point' is a guess" in text
    assert "–" not in text.split("## Slip events")[0].split("value ± 1σ")[1]


def test_opens_paused_on_the_whole_drive(run, path):
    tables = blueprint_of(path)
    time_panel = tables["/time_panel"]
    assert time_panel["TimePanelBlueprint:timeline"] == [["time"]]
    assert time_panel["TimePanelBlueprint:play_state"] == [[1]]  # paused
    shared = tables["/view/5c0dca6a-e63f-9cf7-f657-2602590474cc/TimeAxis"]
    ((shown,),) = shared["TimeAxis:view_range"]
    assert shown["start"] <= 0 and shown["end"] >= run.tracks[0].time[-1] * 1e9
    queries = str(
        [cells["ViewContents:query"] for cells in tables.values() if "ViewContents:query" in cells]
    )
    for entity in ("/can/engine_speed", "/state/temp_disc", "/residual/zero_position", "/mode"):
        assert f"'{entity}'" in queries, entity
    links = [cells["TimeAxis:link"] for cells in tables.values() if "TimeAxis:link" in cells]
    assert len(links) > 5 and all(link == [[2]] for link in links)  # all follow the shared range


def test_drives_stand_one_behind_another(two_drives, tmp_path):
    write_recording(two_drives, tmp_path / "two.rrd")
    moving, _ = read(tmp_path / "two.rrd")
    first, second = two_drives.tracks
    table = moving["/state/temp_disc"]
    value = column(table, "Measurements:values")
    n = len(first.time)
    assert np.isnan(value[n]) and np.isnan(value).sum() == 1  # the line breaks
    np.testing.assert_array_equal(value[n + 1 :], second.states["temp_disc"].value)
    start = seconds(table)[n + 1] - second.time[0]
    assert start > two_drives.signals.end
    lane = column(moving["/drive"], "StateChange:state")
    assert [text.split(",")[0] for text in lane[::2]] == ["drive 0", "drive 1"]


def test_states_without_an_estimate_take_no_room(run, tmp_path):
    (track,) = run.tracks
    unknown = np.full(len(track.time), np.nan)
    friction = Estimate(unknown, unknown, np.zeros(len(unknown), bool))
    track = replace(track, states={**track.states, "friction": friction})
    write_recording(replace(run, tracks=(track,)), tmp_path / "blind.rrd")
    assert np.isnan(
        column(read(tmp_path / "blind.rrd")[0]["/state/friction"], "Measurements:values")
    ).all()
    cells = blueprint_of(tmp_path / "blind.rrd").values()
    queries = str([c["ViewContents:query"] for c in cells if "ViewContents:query" in c])
    assert "'/state/zero_position'" in queries and "'/state/friction'" not in queries


def test_the_differential_opens_with_torque_voltage_current(tmp_path):
    """As ID08 Fig. 11 shows an engagement; how the torque followed is a page of its own."""
    drive = clutchest.simulate("alsd_rig", "rig-steps", 1, duration=4.0)
    run = clutchest.replay(drive, "alsd_rig")
    write_recording(run, tmp_path / "rig.rrd")
    moving, static = read(tmp_path / "rig.rrd")
    (delays,) = (column(moving["/tracking/delay_s"], "Scalars:scalars"),)
    assert delays == pytest.approx([1e3 * r.delay_s for r in run.tracks[0].responses])
    assert "## Tracking" in str(static["/report"].iloc[0].to_dict())
    views = [c for c in blueprint_of(tmp_path / "rig.rrd").values() if "ViewContents:query" in c]
    alone = {str(c["ViewContents:query"][0]) for c in views}
    for name in ("clutch_torque", "armature_voltage", "armature_current"):
        assert f"['/can/{name}']" in alone


def test_nothing_on_the_terminal(run, tmp_path, capfd):
    write_recording(run, tmp_path / "quiet.rrd")
    assert capfd.readouterr() == ("", "")


def test_a_spike_outlives_thinning(run, tmp_path, monkeypatch):
    monkeypatch.setattr(series, "_MOST_ROWS", 200)
    (track,) = run.tracks
    innovations = track.innovations
    spike = np.flatnonzero(innovations.sensor == 0)[1234]
    changed = innovations.innovation.copy()
    changed[spike] = 77.0
    track = replace(track, innovations=replace(innovations, innovation=changed))
    write_recording(replace(run, tracks=(track,)), tmp_path / "thin.rrd")
    table = read(tmp_path / "thin.rrd")[0]["/residual/engine_speed"]
    shown = np.array([cell[0] for cell in table["Scalars:scalars"]])
    assert len(table) <= 200
    assert np.isclose(shown.max(), 77.0 * RPM)
    at = seconds(table)[np.argmax(shown)]
    assert np.isclose(at, innovations.time[spike], atol=1e-9)


@pytest.mark.parametrize("most", [0, 1, 2])
def test_outline_has_two_samples_at_least(most):
    np.testing.assert_array_equal(outline(np.array([3.0, 1.0, 2.0, 9.0, 4.0]), most), [1, 3])


@pytest.mark.parametrize("n", [0, 1, 99, 100, 101, 150, 12_345])
def test_outline_keeps_the_extremes_of_every_stretch(n):
    values = np.random.default_rng(n).normal(size=n)
    values[5:9] = np.nan
    rows = outline(values, 100)
    assert len(rows) <= 100 and np.all(np.diff(rows) > 0)
    if n:
        assert np.nanmax(values[rows]) == np.nanmax(values)
        assert np.nanmin(values[rows]) == np.nanmin(values)
    if n > 100:
        for stretch in np.array_split(np.arange(n), 12):  # no part of the drive is dropped
            assert np.any(np.isin(stretch, rows))


def test_ranges_take_no_infinity():
    made = panel("t", "°C", ["a"], np.array([-np.inf, 2.0]), np.array([np.nan, 5.0]))
    assert made.low < 2.0 and made.high > 5.0 and made.high - made.low < 4.0
    wide = panel("t", "°C", ["a"], np.array([-1.7e308]), np.array([1.7e308]))
    assert wide.low < 0.0 < wide.high
    empty = panel("t", "°C", ["a"], np.array([np.nan]), np.array([np.nan]))
    assert np.isfinite([empty.low, empty.high]).all()


@pytest.mark.parametrize("low, high", [(0.95, 1.06), (41.0, 129.0), (-0.02, 0.003), (3.0, 3.0)])
def test_the_axis_of_a_panel_has_two_numbers_at_least(low, high):
    shown = panel("", "", ["a"], np.array([low]), np.array([high]))
    step = 10.0 ** np.floor(np.log10(shown.high - shown.low))
    assert np.floor(shown.high / step) > np.ceil(shown.low / step)
    assert shown.low < low and high < shown.high


def test_the_opening_page_has_no_more_panels_than_are_legible():
    signals, states = (
        [Panel(f"{kind}{k}", "", (f"{kind}/{k}",), 0.0, 1.0) for k in range(count)]
        for kind, count in (("can", 3), ("state", 6))
    )
    shown = opening(signals, states)
    assert shown == [*signals, *states[2:]] and len(shown) == MOST_PANELS
    assert opening(signals, states[:2]) == [*signals, *states[:2]]


def test_the_opening_page_of_the_truck_has_speeds_and_slave_position():
    run = clutchest.replay("demo", "truck")
    assert [p.title for p in _overview(run)] == ["speeds [rpm]", "slave position [mm]"]
    assert not run.tracks[0].states["wear_rate"].valid.any()
    panels = [Panel(name, "", (f"state/{name}",), 0.0, 1.0) for name in ("wear_rate", "friction")]
    assert _informative(run, panels) == panels[1:]
