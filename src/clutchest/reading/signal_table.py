"""A table of decoded signals, whatever file it was in: columns by name, each with its unit.

What the columns mean is decided in :mod:`clutchest.reading.table_columns`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from clutchest.errors import ClutchestError
from clutchest.reading.written_numbers import numbers_of
from clutchest.signals import Floats

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

DATA_FRAME = "DataFrame"  # source of a table that was in no file


@dataclass(frozen=True, slots=True)
class Cells:
    """One column: ``value`` (n,), NaN where a cell is no number, ``given`` (n,) where it is not
    empty; ``time`` (n,) s of its own, None for the table's."""

    value: Floats
    given: NDArray[np.bool_]
    time: Floats | None = None


class SignalTable(Protocol):
    """A table: ``units`` by the names of its columns, "" where none is stated."""

    @property
    def source(self) -> str:
        """The file's path, or what it is."""

    @property
    def units(self) -> Mapping[str, str]:
        """Unit by name of a column."""

    @property
    def start_ns(self) -> int | None:
        """Epoch time of the times' zero, where the file states it."""

    @property
    def rows(self) -> int:
        """How many rows there are."""

    @property
    def notes(self) -> tuple[str, ...]:
        """What the file has lost, in words."""

    def column(self, name: str) -> Cells:
        """One of the columns."""


@dataclass(frozen=True)
class Frame:
    """A table of pandas'; ``first_row`` is the number of its first row in the file, ``comma``
    whether its numbers have decimal commas."""

    source: str
    frame: pd.DataFrame
    stated: Mapping[str, str] = field(default_factory=dict)
    first_row: int = 2
    start_ns: int | None = None
    notes: tuple[str, ...] = ()
    comma: bool = False

    @property
    def units(self) -> Mapping[str, str]:
        """See :class:`SignalTable`."""
        return {str(name): self.stated.get(str(name), "") for name in self.frame.columns}

    @property
    def rows(self) -> int:
        """See :class:`SignalTable`."""
        return len(self.frame)

    def column(self, name: str) -> Cells:
        """See :class:`SignalTable`."""
        import pandas as pd

        cells = self.cells(name)
        if not pd.api.types.is_string_dtype(cells.dtype):
            value = pd.to_numeric(cells, errors="coerce").to_numpy(np.float64, na_value=np.nan)
            return Cells(value, cells.notna().to_numpy())
        written = cells.astype(object).reset_index(drop=True).replace(r"^\s*$", None, regex=True)
        try:
            return Cells(numbers_of(written, self.comma), written.notna().to_numpy())
        except ClutchestError as problem:
            raise ClutchestError(f"{self.source}: column '{name}': {problem}") from None

    def cells(self, name: str) -> pd.Series:
        """The cells of a column as they are."""
        cells = self.frame[name]
        if getattr(cells, "ndim", 1) != 1:
            raise ClutchestError(f"{self.source}: column '{name}' occurs twice")
        return cells


@dataclass(frozen=True)
class NumberTable:
    """A table of nothing but numbers; ``read`` gives one of its columns, (n,), NaN where a cell is
    empty, so that no more than one of them is in memory."""

    source: str
    units: Mapping[str, str]
    rows: int
    read: Callable[[str], Floats]
    first_row: int = 2
    start_ns: int | None = None
    notes: tuple[str, ...] = ()

    def column(self, name: str) -> Cells:
        """See :class:`SignalTable`."""
        value = self.read(name)
        return Cells(value, ~np.isnan(value))


RowTable = Frame | NumberTable  # tables whose columns share the times of the rows


@dataclass(frozen=True)
class Channels:
    """Columns that have times of their own, as the channels of a measurement do; ``read`` gives one
    of them."""

    source: str
    units: Mapping[str, str]
    start_ns: int | None
    rows: int
    read: Callable[[str], Cells]
    notes: tuple[str, ...] = ()

    def column(self, name: str) -> Cells:
        """See :class:`SignalTable`."""
        return self.read(name)


def as_pandas(given: Any) -> pd.DataFrame:
    """A DataFrame of whatever library as one of pandas'.  Raises ClutchestError for a column of
    one, and for one that is not computed yet."""
    import pandas as pd

    frame = given.to_pandas() if hasattr(given, "to_pandas") else given
    if not isinstance(frame, pd.DataFrame):
        kind = f"{type(given).__module__.split('.')[0]}.{type(given).__name__}"
        raise ClutchestError(f"expected a DataFrame (pandas, polars, Arrow), not {kind}")
    return frame


def units_of(given: Any) -> dict[str, str]:
    """Column → unit, where a DataFrame of Arrow states one."""
    columns = getattr(given, "schema", ())
    return {c.name: unit for c in columns if hasattr(c, "metadata") and (unit := stated_unit(c))}


def stated_unit(column: pa.Field) -> str:
    """The unit of a column of Arrow, "" where none is stated."""
    metadata = column.metadata or {}
    unit = next((metadata[k] for k in (b"unit", b"units", b"Unit") if k in metadata), b"")
    return unit.decode("utf-8", "replace")


def of_frame(source: str, frame: pd.DataFrame, stated: Mapping[str, str] | None = None) -> Frame:
    """A DataFrame whose index is a column too, every level that has a name or holds times."""
    import pandas as pd

    if isinstance(frame.index, pd.DatetimeIndex | pd.TimedeltaIndex) and not frame.index.name:
        frame = frame.rename_axis("time")
    if names := [n for n in frame.index.names if n is not None and n not in frame.columns]:
        frame = frame.reset_index(level=names)
    of_frame = frame.attrs.get("units", {})
    units = {str(k): str(u) for k, u in of_frame.items()} if isinstance(of_frame, dict) else {}
    frame = frame.rename(columns=lambda name: str(name).strip())
    first_row = 0 if source == DATA_FRAME else Frame.first_row
    return Frame(source, frame, {**units, **(stated or {})}, first_row)
