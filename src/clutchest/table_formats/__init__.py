"""Tables as files: a DataFrame whose ``attrs`` say what its columns are, written by suffix.

``attrs["units"]`` column → unit, ``attrs["comments"]`` column → what it is in a few words,
``attrs["start_ns"]`` the epoch time of ``time`` 0, ns, a list with one for every ``drive``, None
where it is not known.  Each may be missing.  A new format is a module with a function ``write``.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from clutchest.errors import ClutchestError

if TYPE_CHECKING:
    import pandas as pd

_MODULES = {".csv": "csv", ".parquet": "parquet", ".xlsx": "xlsx", ".mf4": "mf4", ".mcap": "mcap"}
SUFFIXES = (".csv", ".csv.gz", *list(_MODULES)[1:])
IN_WORDS = f"{', '.join(list(_MODULES)[:-1])} or {list(_MODULES)[-1]}"


def suffix_of(path: Path) -> str | None:
    """The suffix of a table that can be written; None if it is none."""
    name = path.name.lower()
    return next((suffix for suffix in SUFFIXES if name.endswith(suffix)), None)


def write_table(table: pd.DataFrame, path: Path) -> None:
    """Write ``table`` in the format of the suffix: csv (also .gz), Parquet, xlsx, MF4 or MCAP.

    Raises ClutchestError for another suffix, for what a format cannot hold and where its library is
    not installed.
    """
    suffix = suffix_of(path)
    if suffix is None:
        raise ClutchestError(f"{path}: decoded signals are written as {IN_WORDS}")
    module = import_module(f"{__name__}.{_MODULES[suffix.removesuffix('.gz')]}")
    module.write(table, path)


def drives_of(table: pd.DataFrame) -> list[tuple[pd.DataFrame, int | None]]:
    """The rows of every drive, and the epoch time of its ``time`` 0, ns."""
    starts = table.attrs.get("start_ns") or [None]
    if "drive" not in table:
        return [(table, starts[0])]
    return [(rows, starts[number]) for number, rows in table.groupby("drive", sort=True)]
