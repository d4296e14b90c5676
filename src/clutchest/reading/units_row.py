"""Tables of text cells, as csv and Excel have them: a second row may state the units."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from clutchest import units
from clutchest.errors import ClutchestError
from clutchest.reading.signal_table import Frame, of_frame

if TYPE_CHECKING:
    import pandas as pd

_UNITS_ROW = re.compile(r"^\s*[\[(]?\s*([^\W\d][\w/°%·*²³^ .]*|-|%|°C|1/min)\s*[\])]?\s*$")


def of_cells(source: str, frame: pd.DataFrame) -> Frame:
    """A table of text cells, whose second row may state units."""
    frame = frame.rename(columns=lambda name: str(name).strip())
    stated: dict[str, str] = {}
    if len(frame) > 1 and _is_units_row(frame):
        stated = {str(name): _bare(cell) for name, cell in frame.iloc[0].items()}
        frame = frame.iloc[1:].reset_index(drop=True)
    table = of_frame(source, frame, stated)
    return Frame(source, table.frame, table.stated, first_row=3 if stated else 2)


def _is_units_row(frame: pd.DataFrame) -> bool:
    """Whether the first row holds words, one of them a unit, where the others hold numbers."""
    words = [cell for cell in frame.iloc[0] if isinstance(cell, str) and cell.strip()]
    empty = sum(1 for cell in frame.iloc[0] if not isinstance(cell, str) and cell != cell)
    if not words or len(words) + empty < len(frame.columns):
        return False
    known = 0
    for word in words:
        if not _UNITS_ROW.match(word):
            return False
        try:
            units.parse(_bare(word))
        except ClutchestError:
            continue
        known += 1
    return 2 * known >= len(words)


def _bare(cell: Any) -> str:
    return cell.strip().strip("[]()").strip() if isinstance(cell, str) else ""
