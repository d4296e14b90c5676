"""Parquet beyond what a signal may be: lists, bytes, texts that a dictionary keeps small."""

from __future__ import annotations

from decimal import Decimal

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from clutchest import budgets
from clutchest.errors import ClutchestError
from clutchest.reading.table_formats import load_table

ROWS = 1000


def written(path, **more):
    given = pa.table({"time": np.arange(ROWS) * 0.01, "speed": np.full(ROWS, 7.0), **more})
    pq.write_table(given, path, compression="zstd")
    return path


def test_what_is_no_signal_is_left_out(tmp_path):
    path = written(
        tmp_path / "x.parquet",
        lists=pa.array([[0.0] * 500] * ROWS),
        struct=pa.array([{"a": 1}] * ROWS),
        bytes=pa.array([b"x"] * ROWS),
        clock=pa.array([1] * ROWS, pa.time64("us")),
    )
    table = load_table(path)
    assert list(table.units) == ["time", "speed"] and table.rows == ROWS


def test_numbers_and_texts_of_all_kinds(tmp_path):
    kinds = {
        "decimal": pa.array([Decimal("1.5"), None] * (ROWS // 2)),
        "comma": pa.array(["1,5", "2,5"] * (ROWS // 2)),
        "large": pa.array(["1.5", None] * (ROWS // 2), pa.large_string()),
        "coded": pa.array(["1.5", "2.5"] * (ROWS // 2)).dictionary_encode(),
        "whole": pa.array([1, None] * (ROWS // 2), pa.int16()),
        "flag": pa.array([True, None] * (ROWS // 2)),
    }
    table = load_table(written(tmp_path / "x.parquet", **kinds))
    first = {name: table.column(name).value[:2].tolist() for name in kinds}
    np.testing.assert_array_equal(first["decimal"], [1.5, np.nan])
    np.testing.assert_array_equal(first["comma"], [1.5, 2.5])
    np.testing.assert_array_equal(first["large"], [1.5, np.nan])
    np.testing.assert_array_equal(first["coded"], [1.5, 2.5])
    np.testing.assert_array_equal(first["whole"], [1.0, np.nan])
    np.testing.assert_array_equal(first["flag"], [1.0, np.nan])


def test_texts_that_inflate_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(budgets, "TABLE_WORDS", 1 << 20)
    path = written(tmp_path / "x.parquet", words=pa.array(["x" * 4000] * ROWS))
    assert path.stat().st_size < 50_000
    with pytest.raises(ClutchestError, match=r"x\.parquet: column 'words' holds 3 MiB of text"):
        load_table(path)


def test_numbers_that_inflate_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(budgets, "TABLE_CELLS", 2000)
    monkeypatch.setattr(budgets, "BINARY_CELL", 8)
    load_table(written(tmp_path / "x.parquet"))
    path = written(tmp_path / "x.parquet", zero=np.zeros(ROWS))
    with pytest.raises(ClutchestError, match="million numbers"):
        load_table(path)


@pytest.mark.parametrize("index", [None, "number", "time"])
def test_a_table_of_numbers_is_what_pandas_makes_of_it(tmp_path, index):
    path, rng = tmp_path / "x.parquet", np.random.default_rng(1)
    given = {
        "time": pa.array(np.arange(ROWS) * 0.01),
        "half": pa.array(rng.normal(size=ROWS).astype(np.float16)),
        "single": pa.array(rng.normal(size=ROWS).astype(np.float32), mask=rng.random(ROWS) < 0.5),
        "whole": pa.array(rng.integers(-9, 9, ROWS).astype(np.int8), mask=rng.random(ROWS) < 0.9),
        "large": pa.array(rng.integers(0, 1 << 63, ROWS, np.uint64)),
        "nan": pa.array([np.nan, None, np.inf, 1.0] * (ROWS // 4)),
        "empty": pa.array([None] * ROWS, pa.float64()),
    }
    frame = pa.table(given).to_pandas()
    if index is None:
        pq.write_table(pa.table(given), path, row_group_size=300)
    else:
        (frame.rename_axis(index) if index == "number" else frame.set_index(index)).to_parquet(path)
    by_file, by_pandas = load_table(path), load_table(frame)
    for name in given:
        one, other = by_file.column(name), by_pandas.column(name)
        np.testing.assert_array_equal(one.value, other.value)
        np.testing.assert_array_equal(one.given, other.given)
    assert ("number" in by_file.units) == (index == "number")


def test_a_damaged_column_is_one_line(tmp_path):
    path = written(tmp_path / "x.parquet", more=np.random.default_rng(1).random(ROWS))
    content = bytearray(path.read_bytes())
    begin = pq.read_metadata(path).row_group(0).column(2).data_page_offset
    content[begin : begin + 200] = bytes(200)
    path.write_bytes(content)
    with pytest.raises(ClutchestError, match=r"x\.parquet: not a readable table"):
        load_table(path).column("more")


def test_a_damaged_footer_is_read_or_refused_in_a_line(tmp_path):
    """Wherever it is damaged: a column may then have fewer values than the table has rows."""
    whole, damaged = tmp_path / "whole.parquet", tmp_path / "damaged.parquet"
    columns = {"time": 0.02 * np.arange(50), "engine_speed": np.full(50, 100.0)}
    pq.write_table(pa.table(columns), whole, compression="none")
    content = whole.read_bytes()
    footer = int.from_bytes(content[-8:-4], "little")
    refused = set()
    for place in range(len(content) - 8 - footer, len(content) - 8):
        damaged.write_bytes(content[:place] + b"\0" + content[place + 1 :])
        try:
            table = load_table(damaged)
            lengths = {len(table.column(name).value) for name in table.units}
            assert len(lengths) <= 1
        except ClutchestError as problem:
            refused.add(str(problem).partition(": ")[2])
    assert any("values in column" in words for words in refused)
