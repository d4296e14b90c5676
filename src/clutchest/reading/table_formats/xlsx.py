"""An Excel workbook: the table on its first sheet, units and comments on the second one."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from clutchest.errors import ClutchestError
from clutchest.extras import required
from clutchest.reading.signal_table import Frame
from clutchest.reading.table_kind import TableKind
from clutchest.reading.units_row import of_cells

if TYPE_CHECKING:
    import pandas as pd

MOST_ROWS = 1_048_575  # beside the heading


def write(table: pd.DataFrame, path: Path) -> None:
    """Write ``table``; time stamps are UTC, for which Excel has no notation.

    Raises ClutchestError where a sheet has too few rows.
    """
    required("openpyxl")
    from openpyxl import Workbook

    if len(table) > MOST_ROWS:
        raise ClutchestError(
            f"{path}: {len(table)} rows, a sheet holds {MOST_ROWS}; expected another format, or a "
            "lower --rate"
        )
    book = Workbook(write_only=True)
    sheet = book.create_sheet("table")
    sheet.append(list(table.columns))
    for row in zip(*(_cells(table[name]) for name in table.columns), strict=True):
        sheet.append(row)
    about = book.create_sheet("columns")
    about.append(["column", "unit", "comment"])
    units, comments = table.attrs.get("units", {}), table.attrs.get("comments", {})
    for name in table.columns:
        about.append([name, units.get(name, ""), comments.get(name, "")])
    book.save(path)


def _cells(column: pd.Series) -> Iterator[Any]:
    """Values as Excel takes them, None for an empty cell."""
    import pandas as pd

    if isinstance(column.dtype, pd.DatetimeTZDtype):
        column = column.dt.tz_localize(None)
    return iter(column.astype(object).where(column.notna(), None))


def read(path: Path) -> Frame:
    """The table on the first sheet."""
    import pandas as pd

    required("openpyxl")
    return of_cells(str(path), pd.read_excel(path, engine="openpyxl"))


FORMAT = TableKind(
    about="Excel, the first sheet",
    suffixes=(".xlsx",),
    read=read,
    write=write,
    extra="excel",
)
