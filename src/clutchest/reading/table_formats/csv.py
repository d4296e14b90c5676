"""Text with a separator: commas, semicolons, tabs or vertical bars; ``.csv.gz`` compressed.

Written without units, for which there is no place.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from clutchest.can import files, log_source
from clutchest.errors import ClutchestError
from clutchest.reading.signal_table import Frame
from clutchest.reading.table_budget import read_csv
from clutchest.reading.table_kind import TableKind
from clutchest.reading.units_row import of_cells

if TYPE_CHECKING:
    import pandas as pd

_SEPARATORS = ",;\t|"
_PREAMBLE = 40  # lines at most before the header


def write(table: pd.DataFrame, path: Path) -> None:
    """Write ``table``."""
    table.to_csv(path, index=False)


def read(path: Path) -> Frame:
    """The table in a text of whatever encoding, with points or commas in its numbers; behind lines
    of a comment, Excel's ``sep=;`` or words without a separator."""
    lines = _head(path).splitlines()
    separator, before = _layout(lines)
    options: dict[str, Any] = {
        "sep": separator,
        "skiprows": before,
        "skipinitialspace": True,
        "low_memory": False,
        "decimal": "," if separator == ";" and not _points(lines[before:]) else ".",
    }
    try:
        table = of_cells(str(path), read_csv(path, {"encoding": "utf-8-sig", **options}))
    except UnicodeDecodeError:
        table = of_cells(str(path), read_csv(path, {"encoding": "latin-1", **options}))
    comma = options["decimal"] == ","
    return replace(table, first_row=table.first_row + before, comma=comma)


def _layout(lines: Sequence[str]) -> tuple[str, int]:
    """The separator, and how many lines stand before the header."""
    for before, line in enumerate(lines[:_PREAMBLE]):
        if not _is_comment(line) and any(separator in line for separator in _SEPARATORS):
            return max(_SEPARATORS, key=line.count), before
    return ",", 0


def _is_comment(line: str) -> bool:
    return line.startswith(("#", "%", "//")) or bool(re.fullmatch(r"sep=.", line.strip()))


def _points(lines: Sequence[str]) -> bool:
    """Whether numbers in the rows have a decimal point, not a comma."""
    rows = "\n".join(lines[1:50])
    return len(re.findall(r"\d\.\d", rows)) > len(re.findall(r"\d,\d", rows))


def _head(path: Path) -> str:
    with log_source.opened(path) as source:
        return source.head[:65536].decode("utf-8", "replace")


def holds(path: Path) -> bool:
    """Whether a csv is a table, not a log of frames of some format."""
    if not path.is_file():
        return True
    with log_source.opened(path) as source:
        if not source.head.strip():
            return True
        try:
            files.format_of(source)
        except ClutchestError:
            return True
    return False


FORMAT = TableKind(
    about="separated by commas, semicolons, tabs or bars, in any encoding",
    suffixes=(".csv",),
    read=read,
    write=write,
    holds=holds,
    zipped=True,
)
