"""An Excel workbook: the table on its first sheet, units and comments on the second one."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from clutchest import budgets
from clutchest.errors import ClutchestError
from clutchest.extras import required
from clutchest.reading.signal_table import Frame
from clutchest.reading.table_kind import TableKind
from clutchest.reading.units_row import of_cells
from clutchest.reading.workbook_budget import check_workbook

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
    """The table on the first sheet.

    Raises ClutchestError for a workbook beyond its budget.
    """
    required("openpyxl")
    from pandas.io.parsers import TextParser

    check_workbook(path)
    with warnings.catch_warnings():  # of styles and links, which hold no values
        warnings.simplefilter("ignore")
        rows = _rows(path)
    if not rows:
        raise ClutchestError(f"{path}: the first sheet is empty; expected a table of signals")
    return of_cells(str(path), TextParser(rows, header=0).read())


def _rows(path: Path) -> list[list[Any]]:
    """The first sheet's cells to the last one that is not empty, all rows of the same length.

    Raises ClutchestError for more cells than allowed, those before and above the last ones
    included.
    """
    from openpyxl import load_workbook
    from openpyxl.cell.cell import ERROR_CODES

    rows: list[list[Any]] = []
    width = last = 0
    book = load_workbook(path, read_only=True, data_only=True, keep_links=False)
    try:
        sheet = book.worksheets[0]
        sheet.reset_dimensions()  # what it states may be wrong
        for given in sheet.iter_rows(values_only=True):
            row = ["" if cell is None or cell in ERROR_CODES else cell for cell in given]
            while row and row[-1] == "":
                row.pop()
            rows.append(row)
            width, last = max(width, len(row)), len(rows) if row else last
            if len(rows) * max(width, 1) > budgets.XLSX_CELLS:
                raise ClutchestError(
                    f"{path}: its first sheet has more than {budgets.XLSX_CELLS / 1e6:g} million "
                    "cells; save so large a table as csv or Parquet"
                )
    finally:
        book.close()
    return [row + [""] * (width - len(row)) for row in rows[:last]]


FORMAT = TableKind(
    about="Excel, the first sheet",
    suffixes=(".xlsx",),
    read=read,
    write=write,
    extra="excel",
)
