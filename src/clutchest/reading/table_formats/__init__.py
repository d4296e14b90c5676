"""The kinds of tables: every module here is one, and its ``FORMAT`` the entry.

What is written is a DataFrame whose ``attrs`` say what its columns are: ``attrs["units"]`` column →
unit, ``attrs["comments"]`` column → what it is in a few words, ``attrs["start_ns"]`` the epoch time
of ``time`` 0, ns, a list with one for every ``drive``, None where it is not known.  Each may be
missing.
"""

from __future__ import annotations

import pkgutil
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from clutchest.errors import ClutchestError, nearest
from clutchest.paths import named_in_utf8
from clutchest.reading.signal_table import DATA_FRAME, SignalTable, as_pandas, of_frame, units_of
from clutchest.reading.table_kind import TableKind, always

if TYPE_CHECKING:
    import pandas as pd

_MARK = 64  # bytes at most


@cache
def table_formats() -> tuple[TableKind, ...]:
    """All entries, by suffix."""
    names = [module.name for module in pkgutil.iter_modules(__path__)]
    entries = [import_module(f"{__name__}.{name}").FORMAT for name in names]
    return tuple(sorted(entries, key=lambda entry: entry.suffixes))


@cache
def written_suffixes() -> tuple[str, ...]:
    """The suffixes of tables that can be written."""
    kinds = [entry for entry in table_formats() if entry.write]
    return tuple(s for e in kinds for s in _first(e))


@cache
def tables_in_words() -> str:
    """The tables that can be read, for messages that say what is expected."""
    *suffixes, last = (entry.suffixes[0] for entry in table_formats() if entry.read)
    return f"a table of decoded signals ({', '.join(suffixes)} or {last})"


@cache
def read_suffixes() -> frozenset[str]:
    """The suffixes of tables that can be read."""
    return frozenset(s for entry in table_formats() if entry.read for s in entry.suffixes)


def _first(entry: TableKind) -> tuple[str, ...]:
    suffix = entry.suffixes[0]
    return (suffix, f"{suffix}.gz") if entry.zipped else (suffix,)


def suffix_of(path: Path) -> str | None:
    """The suffix of a table that can be written; None if it is none."""
    name = path.name.lower()
    return next((suffix for suffix in written_suffixes() if name.endswith(suffix)), None)


def only_decoded(path: Path) -> bool:
    """Whether a file of this name, to be written, cannot hold frames."""
    kind = _by_suffix(path)
    return kind is not None and kind.holds is always


def write_table(table: pd.DataFrame, path: Path) -> None:
    """Write ``table`` in the format of the suffix.

    Raises ClutchestError for another suffix, for what a format cannot hold and where its library is
    not installed.
    """
    kind = _by_suffix(path)
    if suffix_of(path) is None or kind is None or kind.write is None:
        *others, last = (entry.suffixes[0] for entry in table_formats() if entry.write)
        raise ClutchestError(
            f"{path}: decoded signals are written as {', '.join(others)} or {last}"
        )
    with named_in_utf8(path) as file:
        kind.write(table, file)


def is_table(path: Path) -> bool:
    """Whether the file holds decoded signals, not frames."""
    kind = _kind_of(path)
    return kind is not None and kind.read is not None and kind.holds(path)


def load_table(given: Path | Any) -> SignalTable:
    """The table in a file, or a DataFrame of pandas, polars or Arrow.

    Raises ClutchestError for a file that is none.
    """
    if not isinstance(given, Path):
        return of_frame(DATA_FRAME, as_pandas(given), units_of(given))
    if given.is_file() and not given.stat().st_size:
        raise ClutchestError(
            f"{given}: the file is empty; expected a CAN log or {tables_in_words()}"
        )
    kind = _kind_of(given)
    if kind is None or kind.read is None:
        suffixes = [suffix for entry in table_formats() if entry.read for suffix in entry.suffixes]
        raise ClutchestError(
            f"{given}: no table that is known" + nearest(given.suffix.lower(), suffixes)
        )
    try:
        return kind.read(given)
    except ClutchestError:
        raise
    except Exception as problem:  # the parsers of libraries raise whatever they do
        what = str(problem).splitlines()[0] if str(problem) else type(problem).__name__
        raise ClutchestError(f"{given}: not a readable table: {what}") from None


def _kind_of(path: Path) -> TableKind | None:
    """The kind of table that a file may be: by its first bytes, else by its suffix."""
    begin = b""
    if path.is_file():
        with path.open("rb") as file:
            begin = file.read(_MARK)
    marked = (entry for entry in table_formats() if entry.marks and begin.startswith(entry.marks))
    return next(marked, None) or _by_suffix(path)


def _by_suffix(path: Path) -> TableKind | None:
    name = path.name.lower()
    for entry in table_formats():
        plain = name.removesuffix(".gz") if entry.zipped else name
        if plain.endswith(entry.suffixes):
            return entry
    return None
