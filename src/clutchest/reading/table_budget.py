"""Tables within their budget: a small file may hold a thousand times its size."""

from __future__ import annotations

from collections.abc import Mapping
from io import RawIOBase
from pathlib import Path
from typing import TYPE_CHECKING, Any

from clutchest import budgets
from clutchest.can import log_source
from clutchest.errors import ClutchestError

if TYPE_CHECKING:
    import pandas as pd

PORTION = 100_000  # rows that are read together


def read_csv(path: Path, options: Mapping[str, Any]) -> pd.DataFrame:
    """The table in a csv file, also compressed or in UTF-16, a portion at a time, as far as its
    budget goes.

    ``options`` as pandas takes them.  Raises ClutchestError beyond the budget, and for compressed
    data that end early.
    """
    import pandas as pd

    most = budgets.cells(path, budgets.TEXT_CELL)
    parts, left = [], most
    with log_source.opened(path) as source:
        bounded: Any = _Bounded(source, path)
        for part in pd.read_csv(bounded, chunksize=PORTION, **options):
            left -= part.size
            if left < 0:
                raise too_large(path, most)
            parts.append(part)
        if source.truncated:
            raise ClutchestError(f"{path}: {log_source.GZIP_TRUNCATED}")
    return pd.concat(parts, ignore_index=True) if len(parts) > 1 else parts[0]


def check_cells(path: Path, cells: int) -> None:
    """Raises ClutchestError for a table that says that it holds too many numbers."""
    if cells > (most := budgets.cells(path, budgets.BINARY_CELL)):
        raise too_large(path, most)


def too_large(path: Path, most: int) -> ClutchestError:
    """What is said of a table of more than so many numbers."""
    return ClutchestError(
        f"{path}: holds more than {most / 1e6:.0f} million numbers, or a line "
        "without an end; expected a table of one drive"
    )


class _Bounded(RawIOBase):
    """A file of which no more is read, and no longer line, than its budget allows."""

    def __init__(self, file: Any, path: Path) -> None:
        self.file, self.path = file, path
        self.left = max(budgets.TEXT_BYTES, path.stat().st_size)
        self.line = 0  # bytes since the last line began

    def readable(self) -> bool:
        """Always."""
        return True

    def readinto(self, buffer: Any) -> int:
        """As of any file.  Raises ClutchestError beyond the budget."""
        given = self.file.read(len(buffer))
        self.left -= len(given)
        end = given.rfind(b"\n") + 1
        self.line = len(given) - end if end else self.line + len(given)
        if self.left < 0 or self.line > budgets.LINE_BYTES:
            raise too_large(self.path, budgets.cells(self.path, budgets.TEXT_CELL))
        buffer[: len(given)] = given
        return len(given)
