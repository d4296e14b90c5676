"""The files of a fleet's analysis, beside the dataset that the workers write."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from clutchest.fleet.fleet import Fleet
from clutchest.fleet.one_log import DATASET
from clutchest.fleet.report import fleet_page
from clutchest.paths import readable
from clutchest.reading.table_formats import write_table
from clutchest.record.files import finished_into


def write_fleet(fleet: Fleet, out: Path) -> list[Path]:
    """Write ``summary.parquet`` (a row a vehicle), ``drives.parquet`` (a row a drive) and
    ``report.html``; gives the paths of these and, where it is there, of the dataset."""
    import pandas as pd

    with finished_into(out) as folder:
        write_table(fleet.to_pandas(), folder / "summary.parquet")
        write_table(pd.DataFrame(drive_rows(fleet)), folder / "drives.parquet")
        (folder / "report.html").write_text(readable(fleet_page(fleet)), encoding="utf-8")
        names = sorted(path.name for path in folder.iterdir())
    return [out / name for name in (*names, DATASET) if (out / name).exists()]


def drive_rows(fleet: Fleet) -> list[dict[str, Any]]:
    """One row a drive: its log, when, how much slip, and the states at its end."""
    rows = []
    for one in fleet.vehicles:
        for drive in one.drives:
            row: dict[str, Any] = {"vehicle": one.name}
            row |= {key: value for key, value in drive.items() if key != "states"}
            row["log"] = readable(drive["log"])
            for name, state in drive["states"].items():
                row |= {
                    name: state["value"],
                    f"{name}_std": state["std"],
                    f"{name}_valid": state["valid"],
                }
            rows.append(row)
    return rows
