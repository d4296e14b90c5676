"""Units and clocks as the loggers of rigs write them."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime, timedelta

import numpy as np
import pytest

from clutchest.errors import ClutchestError
from clutchest.reading import read_log
from clutchest.reading.table_columns import split_header
from clutchest.vehicle import TableColumn
from table_rows import written


@pytest.mark.parametrize(
    ("header", "name", "unit"),
    [
        ("p_Bremse [bar]", "p_Bremse", "bar"),
        ("Q (l/min)", "Q", "l/min"),
        ("V [l]", "V", "l"),
        ("wheel speed (L)", "wheel speed (L)", ""),  # the left one
        ("wheel speed (l)", "wheel speed (l)", ""),
    ],
)
def test_litres_are_not_what_is_on_the_left(header, name, unit):
    assert split_header(header) == (name, unit)


@pytest.mark.parametrize(
    ("header", "unit", "warned"),
    [
        ("n [rpm]", "rad/s", "column 'n [rpm]' states rpm, the vehicle file rad/s, which is taken"),
        ("n [rpm]", "1/min", ""),
        ("n_rpm", "rad/s", "column 'n_rpm' states rpm, the vehicle file rad/s, which is taken"),
        ("n [counts]", "rpm", ""),  # no unit of a signal
        ("n", "rpm", ""),
        ("n [rpm]", "", ""),
    ],
)
def test_a_header_that_states_another_unit_is_named(truck, tmp_path, header, unit, warned):
    rows = [f"{0.01 * k:.2f},{300 + 3 * k}" for k in range(200)]
    path = written(tmp_path, "\n".join([f"time,{header}", *rows]))
    vehicle = replace(truck, columns={"engine_speed": TableColumn("n", unit)})
    assert [w for w in read_log(path, vehicle).warnings if "states" in w] == (
        [f"a.csv: {warned}"] if warned else []
    )


def logged(folder, clock: str):
    """A table of 200 rows from 11 March 2024, 08:15:00, on, each with such a ``clock``, which
    leaves out fractions of zero."""
    begin = datetime(2024, 3, 11, 8, 15)
    times = [begin + timedelta(seconds=0.01 * k) for k in range(200)]
    rows = [f"{t.strftime(clock).replace('.000000', '')};{90 + k}" for k, t in enumerate(times)]
    return written(folder, "\n".join(["Zeit;engine_speed", *rows]))


@pytest.mark.parametrize(
    "clock",
    ["%d.%m.%Y %H:%M:%S,%f", "%d.%m.%y %H:%M:%S.%f", "%d-%b-%Y %H:%M:%S.%f", "%Y%m%dT%H%M%S.%f"],
)
def test_a_date_is_read_and_leaves_no_trace_in_the_times(truck, tmp_path, clock):
    """Numbers of s since 1970 are rounded to a quarter of a microsecond: by that much a reading
    would come before or after the moment at which an estimate is written."""
    signals = read_log(logged(tmp_path, clock), truck)
    assert signals.start_ns == 1_710_144_900_000_000_000
    np.testing.assert_array_equal(signals["engine_speed"].time, np.round(0.01 * np.arange(200), 2))


def test_a_clock_that_cannot_be_read_says_which_can(truck, tmp_path):
    with pytest.raises(ClutchestError, match=r"not a number \(200 such.*dates such as 2024-02-29"):
        read_log(logged(tmp_path, "am %d. Tag um %H Uhr"), truck)


@pytest.mark.parametrize(("clock", "warned"), [("%H:%M:%S", True), ("%H:%M:%S.%f", False)])
def test_samples_at_the_same_time_are_named(truck, tmp_path, clock, warned):
    """Of a clock without fractions, or of rows that are there twice."""
    warnings = read_log(logged(tmp_path, clock), truck).warnings
    words = "a.csv: samples of engine_speed have the time of the sample before"
    assert any(w.startswith(words) for w in warnings) == warned


PREAMBLES = {
    "key and value": "Messung;12\nDatum;11.03.2024\n\n",
    "in another separator": "Ort: Halle 3, links, hinten\nBediener: X;Y\n",
    "words": "Messung 12\n",
}


@pytest.mark.parametrize("end", ["", ";"])
@pytest.mark.parametrize("what", PREAMBLES)
def test_words_before_the_header_may_hold_separators(truck, tmp_path, what, end):
    """The header has as many as the rows have, which may end with one more."""
    rows = [f"{0.01 * k:.2f};{90 + 0.1 * k:.1f};80,0;x{end}".replace(".", ",") for k in range(200)]
    header = "Zeit;engine_speed;coolant_temp;Text"
    path = written(tmp_path, PREAMBLES[what] + "\n".join([header, *rows]))
    signals = read_log(path, truck)
    assert len(signals["engine_speed"]) == len(signals["coolant_temp"]) == 200
    np.testing.assert_allclose(signals["engine_speed"].value[[0, -1]], [90.0, 109.9])


def test_a_row_of_numbers_is_no_header(truck, tmp_path):
    """Of rows with more cells than the header names, the first row is still not one."""
    rows = [f"{0.01 * k:.2f};{90 + 0.1 * k:.1f};1;2;3" for k in range(200)]
    path = written(tmp_path, "\n".join(["time;engine_speed", *rows]))
    with pytest.raises(ClutchestError):
        read_log(path, truck)
