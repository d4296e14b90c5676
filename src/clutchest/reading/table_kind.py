"""The entry of one kind of table in the table of formats, beside its reader and writer.

A kind is a module of :mod:`clutchest.reading.table_formats` whose entry is called ``FORMAT``; no
other module mentions it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from clutchest.reading.signal_table import SignalTable

if TYPE_CHECKING:
    import pandas as pd


def always(path: Path) -> bool:
    """Of formats that hold nothing but tables."""
    return True


@dataclass(frozen=True, slots=True)
class TableKind:
    """One kind of file with decoded signals.

    ``about`` it in the documentation; ``suffixes`` by which it is known, the first of them by which
    it is written; ``marks``: first bytes by which it is known whatever its name.  ``read`` and
    ``write``, where it can be; ``holds``: whether a file holds signals, of a kind that may hold
    frames instead.  ``zipped``: ``.gz`` may follow.  ``extra`` of the package that brings the
    libraries which only this kind needs; they are imported within its functions.
    """

    about: str
    suffixes: tuple[str, ...]
    marks: tuple[bytes, ...] = ()
    read: Callable[[Path], SignalTable] | None = None
    write: Callable[[pd.DataFrame, Path], None] | None = None
    holds: Callable[[Path], bool] = always
    zipped: bool = False
    extra: str = ""
