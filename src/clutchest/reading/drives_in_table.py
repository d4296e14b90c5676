"""The drives in a table that is written: the rows of each, and when it began."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd


def drives_of(table: pd.DataFrame) -> list[tuple[pd.DataFrame, int | None]]:
    """The rows of every drive, and the epoch time of its ``time`` 0, ns."""
    starts = table.attrs.get("start_ns") or [None]
    if "drive" not in table:
        return [(table, starts[0])]
    return [(rows, starts[number]) for number, rows in table.groupby("drive", sort=True)]
