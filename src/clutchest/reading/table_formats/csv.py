"""Text with a separator: commas, semicolons, tabs or vertical bars; ``.csv.gz`` compressed.

Written without units, for which there is no place.
"""

from __future__ import annotations

import re
from collections import Counter
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
_NUMBER = re.compile(r"[-+]?[\d.,]+(?:[eE][-+]?\d+)?")


def write(table: pd.DataFrame, path: Path) -> None:
    """Write ``table``."""
    table.to_csv(path, index=False)


def read(path: Path) -> Frame:
    """The table in a text of whatever encoding, with points or commas in its numbers; behind lines
    of a comment, Excel's ``sep=;`` or words, of which none has as many separators as the rows."""
    lines = _head(path).splitlines()
    separator, before = _layout(lines)
    options: dict[str, Any] = {
        "sep": separator,
        "skiprows": before,
        "skipinitialspace": True,
        "low_memory": False,
        "decimal": "," if separator == ";" and not _points(lines[before:]) else ".",
    }
    rows = [line for line in lines[before + 1 :] if line.strip()]
    if rows and rows[0].endswith(separator) and not lines[before].endswith(separator):
        options["index_col"] = False  # else the first column is taken for names of rows
    try:
        table = of_cells(str(path), read_csv(path, {"encoding": "utf-8-sig", **options}))
    except UnicodeDecodeError:
        table = of_cells(str(path), read_csv(path, {"encoding": "latin-1", **options}))
    comma = options["decimal"] == ","
    return replace(table, first_row=table.first_row + before, comma=comma)


def _layout(lines: Sequence[str]) -> tuple[str, int]:
    """The separator, and how many lines stand before the header: the first with as many separators
    as most rows behind it have, and more words than numbers; else the first with any."""
    first = None
    for before, line in enumerate(lines[:_PREAMBLE]):
        if _is_comment(line) or not any(separator in line for separator in _SEPARATORS):
            continue
        first = first or (max(_SEPARATORS, key=line.count), before)
        separator, count = _usual(lines[before + 1 :])
        cells = line.split(separator)
        numbers = sum(bool(_NUMBER.fullmatch(cell.strip())) for cell in cells)
        if count and abs(len(cells) - 1 - count) <= 1 and 2 * numbers < len(cells):
            return separator, before  # a row may end with one more
    return first or (",", 0)


def _usual(rows: Sequence[str]) -> tuple[str, int]:
    """What separates the cells of most rows, and how many there are of it; a comma may be in
    numbers."""
    for separator in sorted(_SEPARATORS, key=",".__eq__):
        counts = Counter(row.count(separator) for row in rows if row.strip())
        if counts and (count := counts.most_common(1)[0][0]):
            return separator, count
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
