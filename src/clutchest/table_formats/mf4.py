"""A measurement in MDF 4 (ASAM): every column a channel with its unit and comment.

A drive is a group of channels with one time; a column with empty cells is a group of its own, with
the times at which it has a value.  Names (the mode, the log) are numbers with a table of texts.
"""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from clutchest.extras import required
from clutchest.table_formats import drives_of

if TYPE_CHECKING:
    import pandas as pd


def write(table: pd.DataFrame, path: Path) -> None:
    """Write ``table``; times count from the file's start, which is that of the first drive."""
    required("asammdf")
    from asammdf import MDF

    drives = drives_of(table)
    known = [start for _, start in drives if start is not None]
    with MDF(version="4.10") as mdf:
        if known:
            mdf.start_time = datetime.fromtimestamp(min(known) / 1e9, UTC)
        for number, (rows, start) in enumerate(drives):
            shift = 0.0 if start is None else (start - min(known)) / 1e9
            name = f"drive {number}" if len(drives) > 1 else "table"
            whole, parts = _channels(rows, rows["time"].to_numpy(np.float64) + shift, table.attrs)
            for group in (whole, *([part] for part in parts)):
                if group:
                    mdf.append(group, acq_name=name, common_timebase=True)
        mdf.save(path, overwrite=True, compression=2)


def _channels(rows: pd.DataFrame, time: Any, attrs: dict[Any, Any]) -> tuple[list[Any], list[Any]]:
    """The channels that have a value in every row, and those with values in some."""
    from asammdf import Signal

    whole: list[Any] = []
    parts: list[Any] = []
    for name in rows.columns:
        if name in ("time", "timestamp"):  # the times of the channels and the start of the file
            continue
        given = rows[name].notna().to_numpy()
        if not given.any():
            continue
        values, texts = _numbers(rows[name][given])
        channel = Signal(
            samples=values,
            timestamps=time[given],
            name=name,
            unit=attrs.get("units", {}).get(name, ""),
            comment=attrs.get("comments", {}).get(name, ""),
            conversion=texts,
        )
        (whole if given.all() else parts).append(channel)
    return whole, parts


def _numbers(column: pd.Series) -> tuple[Any, dict[str, Any] | None]:
    """Numbers, and the texts that they stand for if any."""
    import pandas as pd

    if column.dtype == bool:
        return column.to_numpy(np.uint8), None
    if pd.api.types.is_numeric_dtype(column):
        return column.to_numpy(), None
    codes, names = pd.factorize(column.astype(str), sort=True)
    texts: dict[str, Any] = {}
    for code, name in enumerate(names):
        texts |= {f"val_{code}": code, f"text_{code}": str(name).encode()}
    return codes.astype(np.uint16), texts
