"""Numbers in tables with points or commas, and with digits in groups."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from clutchest.errors import ClutchestError
from clutchest.reading import read_log
from clutchest.reading.table_inspection import inspect_tables
from clutchest.reading.written_numbers import numbers_of
from clutchest.vehicle import load_vehicle

CELLS = {
    "grouped by commas": (["1,234.5", "950.25", "-12,345"], [1234.5, 950.25, -12345.0]),
    "twice": (["1,234,567", "1,000"], [1234567.0, 1000.0]),
    "points beside": (["1,234", "950.5", "7"], [1234.0, 950.5, 7.0]),
    "grouped by points": (["1.234,5", "950,25", "-12.345"], [1234.5, 950.25, -12345.0]),
    "commas beside": (["1.234", "950,5", "7"], [1234.0, 950.5, 7.0]),
    "small numbers": (["0,512", "1,234"], [0.512, 1.234]),
    "decimal commas": (["12,5", "1,234"], [12.5, 1.234]),
    "blanks": (["1 234,5", "1\u202f234", "2\u00a0000,0"], [1234.5, 1234.0, 2000.0]),
    "apostrophes": (["1'234.5", "12’000"], [1234.5, 12000.0]),
    "exponents": (["1,5e3", "2E-1"], [1500.0, 0.2]),
    "words between": (["n/a", "1,234.5", "20.11.2023"], [np.nan, 1234.5, np.nan]),
    "both": (["1.5", "2,5", "1,234.5", "7"], [1.5, np.nan, 1234.5, 7.0]),
    "numbers": ([3, "1,234.5"], [3.0, 1234.5]),
    "points": (["1.234", "950"], [1.234, 950.0]),
    "no numbers": (["Gear 1", "1.2.3,4"], [np.nan, np.nan]),
}


@pytest.mark.parametrize("what", CELLS)
def test_marks_are_told_by_the_whole_column(what):
    cells, expected = CELLS[what]
    np.testing.assert_array_equal(numbers_of(pd.Series(cells, dtype=object), False), expected)


def test_where_nothing_tells_the_file_does():
    cells = pd.Series(["1.234", "2.000", "950"], dtype=object)
    np.testing.assert_array_equal(numbers_of(cells, True), [1234.0, 2000.0, 950.0])
    with pytest.raises(ClutchestError, match=r"'1,234' may be 1234 or 1\.234: write"):
        numbers_of(pd.Series(["1,234", "950"], dtype=object), False)


STYLES = {
    "English": (",", ".", ",", '"'),
    "German": (";", ",", ".", ""),
    "Swiss": (";", ".", "'", ""),
    "French": (";", ",", "\u202f", ""),
}


@pytest.mark.parametrize("style", STYLES)
def test_a_table_of_grouped_digits(style, tmp_path):
    separator, mark, group, quote = STYLES[style]
    time, rpm = np.arange(300) * 10.0, 900.0 + np.arange(300) / 2

    def number(value: float) -> str:
        text = f"{value:,.1f}".replace(".", "|").replace(",", group).replace("|", mark)
        return f"{quote}{text}{quote}"

    rows = [separator.join(map(number, row)) for row in zip(time, rpm, strict=True)]
    path = tmp_path / "a.csv"
    path.write_text("\n".join([f"time [ms]{separator}engine_speed [rpm]", *rows]), "utf-8")
    log = read_log(path, load_vehicle("truck"))
    np.testing.assert_allclose(log["engine_speed"].time, time / 1e3, atol=1e-9)
    np.testing.assert_allclose(log["engine_speed"].value, rpm * np.pi / 30)
    assert log.warnings == ()


def test_a_column_that_may_be_either_is_refused_with_its_name(tmp_path):
    path = tmp_path / "a.csv"
    rows = [f'{k / 10},100.5,"1,{100 + k}"' for k in range(100)]
    path.write_text("\n".join(["time,engine_speed,engine_torque", *rows]))
    with pytest.raises(ClutchestError, match=r"a\.csv: column 'engine_torque': '1,100' may be"):
        read_log(path, load_vehicle("truck"))
    found = inspect_tables([path])
    assert any("column 'engine_torque': '1,100' may be" in words for words in found.warnings)
