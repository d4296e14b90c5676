"""Comma-separated values; ``.csv.gz`` compressed.  There is no place for units."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd


def write(table: pd.DataFrame, path: Path) -> None:
    """Write ``table``."""
    table.to_csv(path, index=False)
