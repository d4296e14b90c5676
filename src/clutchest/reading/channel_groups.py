"""Tables whose columns come in groups, each with times of its own, as MATLAB's and NI's do."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clutchest.errors import ClutchestError
from clutchest.reading.signal_table import Cells, Channels, Frame, SignalTable, of_frame
from clutchest.reading.table_columns import Clock, clock_of

Array = NDArray[Any]


@dataclass(frozen=True)
class Group:
    """Columns (n,) of one length: path → samples, and the ``units`` of some.

    ``time`` (n,) s and ``start_ns``, the epoch time of its zero, where the file states them apart
    from the columns; without it one of the columns is the time.
    """

    columns: Mapping[str, Array]
    units: Mapping[str, str] = field(default_factory=dict)
    time: Array | None = None
    start_ns: int | None = None


def table_of(
    source: str, groups: Sequence[Group], separator: str, notes: tuple[str, ...] = ()
) -> SignalTable:
    """The table that ``groups`` make: one of rows where a single one has a column of times.

    A column is called by the last part of its path, by all of it where that occurs twice.  Raises
    ClutchestError where there is no column.
    """
    groups = [group for group in groups if group.columns]
    if not groups:
        raise ClutchestError(f"{source}: no column of numbers")
    named = _named(groups, separator)
    clocks = [_clock(source, group) for group in named]
    known = [group for group, clock in zip(named, clocks, strict=True) if clock]
    if len(known) < 2 and all(group.time is None for group in named):
        return replace(_rows(source, max(known or named, key=_length)), notes=notes)
    starts = [clock.start_ns for clock in clocks if clock and clock.start_ns is not None]
    first = min(starts) if starts else None
    cells: dict[str, Cells] = {}
    for group, clock in zip(named, clocks, strict=True):
        if clock is None:
            continue
        shift = 0.0 if clock.start_ns is None or first is None else (clock.start_ns - first) / 1e9
        rows = _rows(source, group)
        for name in group.columns:
            if name != clock.column:
                column = rows.column(name)
                cells[name] = replace(column, time=clock.time + shift)
    units = {name: group.units.get(name, "") for group in named for name in group.columns}
    length = {name: len(values) for group in named for name, values in group.columns.items()}

    def read(name: str) -> Cells:
        if name not in cells:
            raise ClutchestError(
                f"{source}: '{name}' has {length[name]} samples and no times: expected a column "
                "'time' of as many beside it"
            )
        return cells[name]

    return Channels(source, units, first, max(length.values()), read, notes)


def _named(groups: Sequence[Group], separator: str) -> list[Group]:
    """The groups with short names, where those tell the columns apart."""
    paths = [path for group in groups for path in group.columns]
    times = Counter(path.rpartition(separator)[2] for path in paths)

    def name(path: str) -> str:
        short = path.rpartition(separator)[2]
        return short if short and times[short] == 1 else path

    return [
        replace(
            group,
            columns={name(path): values for path, values in group.columns.items()},
            units={name(path): unit for path, unit in group.units.items()},
        )
        for group in groups
    ]


def _length(group: Group) -> int:
    return len(next(iter(group.columns.values())))


def _rows(source: str, group: Group) -> Frame:
    import pandas as pd

    return of_frame(source, pd.DataFrame(dict(group.columns)), group.units)


def _clock(source: str, group: Group) -> Clock | None:
    """The times of a group; None where it has none."""
    if group.time is not None:
        return Clock(np.asarray(group.time, np.float64), group.start_ns, "")
    short = {path: path.rpartition("/")[2].rpartition(".")[2] for path in group.columns}
    table = _rows(source, replace(group, columns={short[p]: v for p, v in group.columns.items()}))
    try:
        clock = clock_of(table, {})
    except ClutchestError:
        return None
    column = next(path for path in group.columns if short[path] == clock.column)
    return replace(clock, column=column)
