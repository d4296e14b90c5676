"""Tables in every format, opened again by the reader of its own."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import clutchest
from clutchest.cli import app
from clutchest.errors import ClutchestError
from clutchest.estimate.run import Run
from clutchest.reading.table_formats import write_table, xlsx
from clutchest.record.files import write_run
from clutchest.units import convert

START = 1_700_000_000_250_000_000


@pytest.fixture
def table() -> pd.DataFrame:
    """Two drives, empty cells, texts, truths."""
    made = pd.DataFrame(
        {
            "time": [0.0, 0.1, 0.2, 0.0, 0.1],
            "drive": np.array([0, 0, 0, 1, 1], np.int32),
            "mode": pd.Categorical(["open", "slipping", "open", "locked", "locked"]),
            "temperature": [80.0, np.nan, 82.5, 90.25, 1 / 3],
            "valid": [True, False, True, True, True],
        }
    )
    starts = [START, START + 3_600_000_000_000]
    made["timestamp"] = pd.to_datetime(
        [starts[d] + round(t * 1e9) for d, t in zip(made.drive, made.time, strict=True)], utc=True
    )
    made.attrs.update(
        units={"time": "s", "temperature": "°C"},
        comments={"temperature": "of the disc"},
        start_ns=starts,
    )
    return made


def test_mf4(table: pd.DataFrame, tmp_path: Path) -> None:
    asammdf = pytest.importorskip("asammdf")
    write_table(table, tmp_path / "x.mf4")
    with asammdf.MDF(tmp_path / "x.mf4") as mdf:
        assert mdf.start_time.timestamp() == pytest.approx(START / 1e9, abs=1e-6)
        groups = [(g, i) for g, i in mdf.whereis("temperature")]
        first, second = (mdf.get("temperature", group=g, index=i) for g, i in groups)
        assert (first.unit, first.comment) == ("°C", "of the disc")
        assert first.samples.tolist() == [80.0, 82.5]
        assert first.timestamps == pytest.approx([0.0, 0.2])
        assert second.samples.tolist() == [90.25, 1 / 3]
        assert second.timestamps == pytest.approx([3600.0, 3600.1])
        g, i = mdf.whereis("mode")[0]
        assert mdf.get("mode", group=g, index=i).samples.tolist() == [b"open", b"slipping", b"open"]


def test_mcap(table: pd.DataFrame, tmp_path: Path) -> None:
    reader = pytest.importorskip("mcap.reader")
    write_table(table, tmp_path / "x.mcap")
    with (tmp_path / "x.mcap").open("rb") as file:
        rows = list(reader.make_reader(file).iter_messages())
    schema, channel, _ = rows[0]
    assert json.loads(channel.metadata["units"]) == table.attrs["units"]
    properties = json.loads(schema.data)["properties"]
    assert properties["temperature"] == {"type": "number", "description": "of the disc [°C]"}
    assert properties["valid"]["type"] == "boolean"
    stamps = [message.log_time for _, _, message in rows]
    assert stamps == table["timestamp"].astype("int64").tolist()
    read = [json.loads(message.data) for _, _, message in rows]
    assert "temperature" not in read[1]
    assert read[4]["temperature"] == pytest.approx(1 / 3, rel=1e-14)
    assert [row["mode"] for row in read] == table["mode"].tolist()


def test_xlsx(table: pd.DataFrame, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("openpyxl")
    write_table(table, tmp_path / "x.xlsx")
    read = pd.read_excel(tmp_path / "x.xlsx", sheet_name=None)
    assert read["table"]["temperature"].equals(table["temperature"])
    assert read["table"]["mode"].tolist() == table["mode"].tolist()
    about = read["columns"].set_index("column")
    assert about.loc["temperature"].tolist() == ["°C", "of the disc"]
    monkeypatch.setattr(xlsx, "MOST_ROWS", 4)
    with pytest.raises(ClutchestError, match="5 rows, a sheet holds 4"):
        write_table(table, tmp_path / "y.xlsx")


def test_parquet_and_csv(table: pd.DataFrame, tmp_path: Path) -> None:
    import pyarrow.parquet as pq

    write_table(table, tmp_path / "x.parquet")
    write_table(table, tmp_path / "x.csv.gz")
    pd.testing.assert_frame_equal(pd.read_parquet(tmp_path / "x.parquet"), table)
    field = pq.read_schema(tmp_path / "x.parquet").field("temperature")
    assert field.metadata[b"unit"].decode() == "°C"
    read = pd.read_csv(tmp_path / "x.csv.gz")
    assert read["temperature"].equals(table["temperature"])


def test_another_suffix(table: pd.DataFrame, tmp_path: Path) -> None:
    with pytest.raises(
        ClutchestError, match=r"x\.ods: .*\.csv, \.mcap, \.mf4, \.parquet or \.xlsx"
    ):
        write_table(table, tmp_path / "x.ods")


@pytest.fixture(scope="module")
def run() -> Run:
    truck = clutchest.load_vehicle("truck")
    return clutchest.replay("demo", truck)


def test_estimates_in_every_format(run: Run, tmp_path: Path) -> None:
    pytest.importorskip("mcap")
    written = write_run(run, tmp_path, formats=["csv", "xlsx", "mf4", "mcap"])
    names = {path.name for path in written}
    assert {f"estimates.{suffix}" for suffix in ("csv", "xlsx", "mf4", "mcap", "parquet")} <= names
    table = run.to_pandas()
    assert pd.read_csv(tmp_path / "estimates.csv")["temp_disc"].equals(table["temp_disc"])
    asammdf = pytest.importorskip("asammdf")
    with asammdf.MDF(tmp_path / "estimates.mf4") as mdf:
        disc = mdf.get("temp_disc")
        assert disc.unit == "°C" and disc.comment
        assert np.array_equal(disc.samples, table["temp_disc"])
        assert mdf.get("temp_disc_std").comment == f"standard deviation of {disc.comment}"
        described = {name for name in table if table.attrs["comments"].get(name)}
        assert described == set(table)


def test_absolute_time_and_log(run: Run) -> None:
    table = run.to_pandas()
    assert set(table["log"]) == {"demo.log.gz"}
    start = run.signals.start_ns
    assert start is not None
    stamps = table["timestamp"].astype("int64").to_numpy()
    assert np.abs(stamps - start - table["time"].to_numpy() * 1e9).max() <= 1.0
    relative = clutchest.replay(run.signals.to_pandas(), run.vehicle).to_pandas()
    assert relative["timestamp"].isna().all()
    assert relative.attrs["start_ns"] == [None]


def test_signals_as_tables(run: Run) -> None:
    table = run.signals.to_pandas()
    assert table.attrs["units"]["engine_speed"] == "rad/s"
    polars = pytest.importorskip("polars")
    assert run.to_polars()["temp_disc"].equals(
        polars.Series("temp_disc", run.to_pandas()["temp_disc"])
    )
    assert run.signals.to_polars().columns == list(table)


@pytest.mark.parametrize("suffix", ["xlsx", "mf4", "mcap"])
def test_convert(tmp_path: Path, suffix: str, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("mcap")
    out = tmp_path / f"x.{suffix}"
    arguments = [
        "convert",
        "demo",
        "--vehicle",
        "truck",
        "-o",
        str(out),
        "--from",
        "10",
        "--to",
        "12",
    ]
    app(arguments, standalone_mode=False)
    assert f"Written: {out}" in capsys.readouterr().out
    if suffix == "mf4":
        asammdf = pytest.importorskip("asammdf")
        with asammdf.MDF(out) as mdf:
            speed = mdf.get("engine_speed")
        assert speed.unit == "rad/s"
        assert 500 < convert(speed.samples, "rad/s", "rpm").mean() < 3000
