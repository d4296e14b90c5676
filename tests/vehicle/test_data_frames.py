"""DataFrames, and what is taken for one by mistake."""

from __future__ import annotations

from dataclasses import replace
from io import StringIO

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest

import clutchest
from clutchest.errors import ClutchestError
from clutchest.reading import read_log
from clutchest.vehicle import load_vehicle
from table_rows import SPEED, TIME, N

FRAME = pd.DataFrame({"time": TIME, "engine_speed": SPEED})


def test_what_is_no_frame_is_named(truck):
    signals = read_log(FRAME, truck)
    wrong = {
        "pyarrow.ChunkedArray": pa.table({"a": [1.0]})["a"],
        "Styler": FRAME.head().style,
        "dict": dict(FRAME),
        "bytes": b"x",
        "StringIO": StringIO("time,engine_speed\n"),
        "Signals": signals,
    }
    for name, given in wrong.items():
        with pytest.raises(ClutchestError, match=rf"^expected .*DataFrame .*, not {name}$"):
            read_log(given, truck)


def test_a_frame_that_is_not_computed_yet_is_none(truck):
    polars = pytest.importorskip("polars")
    for given in (polars.from_pandas(FRAME).lazy(), polars.from_pandas(FRAME)["time"]):
        with pytest.raises(ClutchestError, match=r"DataFrame .*, not polars\.(LazyFrame|Series)"):
            read_log(given, truck)


def test_frames_that_are_joined_twice_are_named(truck):
    warnings = read_log(pd.concat([FRAME, FRAME]), truck).warnings
    assert any("samples of engine_speed have the time of the sample before" in w for w in warnings)
    assert not read_log(FRAME, truck).warnings


def test_rows_without_a_time_are_counted(truck):
    dates = pd.to_datetime(TIME, unit="s", origin="2024-05-01").to_series(index=FRAME.index)
    signals = read_log(FRAME.assign(time=dates.where(FRAME.index % 50 != 3)), truck)
    assert len(signals["engine_speed"]) == N - N // 50
    assert signals.warnings == (f"DataFrame: {N // 50} rows without a time left out",)


def test_an_index_without_a_name_is_asked_for_one(truck):
    unnamed = FRAME.set_index("time").rename_axis(None)
    with pytest.raises(ClutchestError, match="no column or index of times, expected one named"):
        read_log(unnamed, truck)
    assert len(read_log(unnamed.rename_axis("time"), truck)["engine_speed"]) == N


def test_named_levels_of_an_index_are_columns(truck):
    """As of frames that were joined under keys."""
    keyed = pd.concat({"a": FRAME.set_index("time")}, names=["log"])
    signals = read_log(keyed, truck)
    assert len(signals["engine_speed"]) == N
    assert [w.split(";")[0] for w in signals.warnings] == ["DataFrame: column 'log' ignored"]


def test_rows_of_a_frame_are_counted_as_pandas_does(truck):
    words = FRAME.astype({"engine_speed": object})
    words.loc[3, "engine_speed"] = "n/a"
    (warning,) = read_log(words, truck).warnings
    assert warning.startswith("DataFrame: row 3: engine_speed 'n/a' is not a number")


def test_estimates_are_no_log(truck):
    run = clutchest.replay("demo", truck)
    with pytest.raises(ClutchestError, match="DataFrame: is a result of clutchest, expected a log"):
        read_log(run.to_pandas(), truck)


def test_a_frame_is_no_file_to_inspect(truck):
    with pytest.raises(ClutchestError, match=r"; they may be renamed, or named in \[columns\]"):
        read_log(FRAME.rename(columns={"engine_speed": "n_eng"}), truck)


@pytest.mark.parametrize(("unit", "factor"), [("us", 1e6), ("ns", 1e9)])
def test_the_unit_of_times_may_be_any(truck, tmp_path, edited, unit, factor):
    table = FRAME.assign(time=TIME * factor)
    with pytest.raises(ClutchestError, match=rf"is the time in {unit}\? .*'time \[{unit}\]'"):
        read_log(table, truck)
    stated = load_vehicle(edited(extra=f'\n[columns]\ntime = {{ column = "t", unit = "{unit}" }}'))
    read = read_log(table.rename(columns={"time": "t"}), stated)["engine_speed"]
    np.testing.assert_allclose(read.time, TIME - TIME[0], atol=1e-9)


def test_a_list_of_signals_is_their_drives(truck):
    some = [clutchest.simulate(truck, "city", seed=seed, duration=20) for seed in (1, 2)]
    run = clutchest.replay(some, truck)
    assert [drive.start_ns for drive in run.signals.drives] == [each.start_ns for each in some]
    assert all(drive.traffic for drive in run.signals.drives)
    again = clutchest.replay([clutchest.replay(some[0], truck), some[1]], truck)
    assert again.summary["states"] == run.summary["states"]
    with pytest.raises(ClutchestError, match="expected signals, a log or a run, not a Diagnosis"):
        clutchest.replay([clutchest.diagnose(some[0], truck)], truck)


def test_a_file_that_is_neither_log_nor_table_is_not_said_to_hold_frames(truck, tmp_path):
    """For a vehicle whose file maps columns alone."""
    FRAME.to_pickle(tmp_path / "a.pkl")
    with pytest.raises(ClutchestError, match=r"a\.pkl: not a CAN log that is known; .* or a table"):
        read_log(tmp_path / "a.pkl", replace(truck, dbc=()))
