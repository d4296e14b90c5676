"""Already decoded signals: tables in, CSV and Parquet with canonical columns out."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from clutchest import units
from clutchest.budgets import LARGEST
from clutchest.can.time_stamps import LAST_S
from clutchest.errors import ClutchestError, nearest
from clutchest.models import shipped_machines
from clutchest.reading.account import together
from clutchest.reading.signal_table import DATA_FRAME, RowTable, SignalTable
from clutchest.reading.table_columns import (
    TIME,
    Clock,
    Place,
    clock_of,
    contrary_words,
    header_of,
    is_time,
    missing_words,
    not_numbers,
    places,
    split_header,
)
from clutchest.reading.table_formats import load_table, write_table
from clutchest.reading.table_units import check_steps, check_units, doubtful_units
from clutchest.shown import counted
from clutchest.signals import Counts, Floats, Signal, Signals
from clutchest.vehicle import TableColumn, Vehicle

if TYPE_CHECKING:
    import pandas as pd

_INDEX = re.compile(r"^(Unnamed: \d+|index|Index|#|)$")
_MOST_NAMED = 8  # columns that are not used


@np.errstate(all="ignore")  # a file may hold any number
def read_table(
    given: Path | Any, columns: Mapping[str, str], vehicle: Vehicle | None = None
) -> Signals:
    """The canonical signals in a table, a file or a DataFrame; ``columns`` are the names known,
    with their units.

    A header may state a unit (``engine_speed [rpm]``); the ``[columns]`` of a ``vehicle`` name
    columns and units of their own.  One row per time stamp, an empty cell where a signal has no
    sample.  Times begin near 0: others are counted from the first.  Cells that are no
    numbers are rejected one by one, rows without a time whole.  Raises ClutchestError if the time
    or every known column is missing, and for values that do not fit their unit.
    """
    import pyarrow

    table = load_table(given)
    mapped = vehicle.columns if vehicle is not None else {}
    found = places(table, columns, mapped)
    if not found:
        raise _nothing_known(table, columns, mapped)
    if any({f"{name}_std", f"{name}_valid"} <= set(table.units) for name in found):
        raise ClutchestError(f"{table.source}: is a result of clutchest, expected a log")
    clock = clock_of(table, mapped) if isinstance(table, RowTable) else None
    file = Path(table.source).name
    warnings = [f"{file}: {words}" for words in table.notes]
    warnings += [*missing_words(table, found, mapped), *contrary_words(table, found)]
    warnings += clock.warnings if clock else ()
    if not mapped:
        warnings += _ignored(table, found, columns, clock)
    rows = _Rows(table, clock, warnings)
    signals = {name: rows.signal(name, place, columns, vehicle) for name, place in found.items()}
    if vehicle is not None:
        stated = {name: place.unit for name, place in found.items()}
        _check(table, clock, signals, stated, vehicle)
        warnings += [f"{file}: {words}" for words in doubtful_units(signals, stated, vehicle)]
    result = rows.result(signals)
    del table, clock, rows
    pyarrow.default_memory_pool().release_unused()  # else it keeps what reading took
    return result


def _nothing_known(
    table: SignalTable, columns: Mapping[str, str], mapped: Mapping[str, TableColumn]
) -> ClutchestError:
    unknown = [name for name in table.units if not (_INDEX.match(name) or is_time(name))]
    known = [how.column for name, how in mapped.items() if name != TIME] or columns
    hint = nearest(unknown[0], known) if unknown else ""
    return ClutchestError(
        f"{table.source}: no known signal among its columns: "
        f"{', '.join(unknown[:_MOST_NAMED]) or 'none at all'}{hint}{_whose(table, unknown)}"
    )


def _whose(table: SignalTable, unknown: Sequence[str]) -> str:
    """Of which machine the ``unknown`` columns are, else how they become known."""
    headers = {header: split_header(header) for header in unknown}
    for machine in shipped_machines():
        if sum(header_of(name, headers) is not None for name in machine.units) > 1:
            return f"; they are those of machine '{machine.name}', as of vehicle {machine.template}"
    if not unknown:
        return ""
    if table.source == DATA_FRAME:
        return "; they may be renamed, or named in [columns] of a vehicle file"
    file = Path(table.source).name
    return f"; `clutchest inspect {file}` drafts a vehicle file whose [columns] name them"


def _ignored(
    table: SignalTable, found: Mapping[str, Place], columns: Mapping[str, str], clock: Clock | None
) -> list[str]:
    used = {place.column for place in found.values()} | ({clock.column} if clock else set())
    left = [name for name in table.units if name not in used and not _INDEX.match(name)]
    file = Path(table.source).name
    words = [f"{file}: column '{n}' ignored{nearest(n, columns)}" for n in left[:_MOST_NAMED]]
    more = len(left) - _MOST_NAMED
    return [*words, *([f"{file}: {more} more columns ignored"] if more > 0 else [])]


def _check(
    table: SignalTable,
    clock: Clock | None,
    signals: Mapping[str, Signal],
    units: Mapping[str, str],
    vehicle: Vehicle,
) -> None:
    """Raises ClutchestError naming the table for values that do not fit their units."""
    try:
        if clock is not None and clock.start_ns is None:
            stated = bool(split_header(clock.column)[1] or table.units.get(clock.column))
            stated |= TIME in vehicle.columns
            check_steps(clock.time[np.isfinite(clock.time)], stated, vehicle)
        check_units(signals, units, vehicle)
    except ClutchestError as problem:
        raise ClutchestError(f"{table.source}: {problem}") from None


@dataclass
class _Rows:
    """Signals made of the rows of a table, and what was lost."""

    table: SignalTable
    clock: Clock | None
    warnings: list[str]
    useful: int = 0
    end: float = 0.0
    rejected: int = 0

    def __post_init__(self) -> None:
        if self.clock is not None:
            timed = np.isfinite(self.clock.time)
            self.rejected = int((~timed).sum())
            if self.rejected:
                rows = f"{counted(self.rejected, 'row')} without a time left out"
                self.warnings.append(f"{Path(self.table.source).name}: {rows}")
            self.end = float(self.clock.time[timed].max())
            self.warnings += _backward(self.table, self.clock.time, timed)
        self._useful = np.zeros(self.table.rows, bool)

    def signal(
        self, name: str, place: Place, columns: Mapping[str, str], vehicle: Vehicle | None
    ) -> Signal:
        """The canonical signal ``name``, from its column."""
        column = self.table.column(place.column)
        file = Path(self.table.source).name
        if isinstance(self.table, RowTable):
            self.warnings += not_numbers(self.table, place.column, name, column)
        beyond = np.abs(column.value) > LARGEST
        if beyond.any():
            column = replace(column, value=np.where(beyond, np.nan, column.value))
            self.warnings.append(
                f"{file}: column '{place.column}': {np.count_nonzero(beyond)} values beyond "
                f"{LARGEST:g} are not used"
            )
        if self.clock is not None:
            time, given = self.clock.time, column.given & np.isfinite(self.clock.time)
            self._useful |= given & np.isfinite(column.value)
        else:
            assert column.time is not None
            time, given = column.time, column.given & (np.abs(column.time) <= LAST_S)
            self.end = max(self.end, float(time[given].max(initial=0.0)))
            self.useful = max(self.useful, int(given.sum()))
        if not given.any():
            self.warnings.append(f"{file}: column '{place.column}' is empty")
        rows = slice(None) if given.all() else np.flatnonzero(given)  # quicker than a mask
        value = self._in_unit(column.value[rows], name, place, columns[name], vehicle)
        return Signal.of(name, columns[name], time[rows], value)

    def _in_unit(
        self, value: Floats, name: str, place: Place, unit: str, vehicle: Vehicle | None
    ) -> Floats:
        """Values of a column in the ``unit`` of its signal; percent of what the vehicle file
        states."""
        if place.unit != "%" or units.compatible("%", unit):
            return units.convert_reading(value, place.unit, unit)
        how = vehicle.signals.get(name) if vehicle is not None else None
        if how is None or how.reference is None or how.friction is not None:
            raise ClutchestError(
                f"{self.table.source}: column '{place.column}' is in %, expected {unit}: [columns] "
                f"of the vehicle file states what 100 % stands for: {name} = {{ column = "
                f'"{place.column}", unit = "%", reference = {{ value = …, unit = "{unit}" }} }}'
            )
        return value * (how.reference / 100.0)

    def _begin(self, signals: Mapping[str, Signal]) -> float:
        """The time, s, from which all others are counted: 0, unless the first is before it, or
        later than any other comes after the one before it, as of a clock that shows the time of
        day or a piece of a longer record."""
        times = [signal.time for signal in signals.values() if len(signal)]
        first = min((float(time[0]) for time in times), default=0.0)
        longest = max((float(np.diff(time).max(initial=0.0)) for time in times), default=0.0)
        return first if first < 0.0 or first > longest else 0.0

    def result(self, signals: dict[str, Signal]) -> Signals:
        """All of them, with an account."""
        useful = int(self._useful.sum()) if self.clock is not None else self.useful
        start_ns = self.clock.start_ns if self.clock is not None else self.table.start_ns
        self.warnings += together(signals, Path(self.table.source).name)
        begin = self._begin(signals)
        if begin:
            file = Path(self.table.source).name
            self.warnings.append(f"{file}: time begins at {begin:g} s; counted from there")
            signals = {n: replace(s, time=s.time - begin) for n, s in signals.items()}
        return Signals(
            signals,
            start_ns=None if start_ns is None else start_ns + round(begin * 1e9),
            end=self.end - begin,
            counts=Counts(
                self.table.rows, useful, {"no time": self.rejected} if self.rejected else {}
            ),
            warnings=tuple(self.warnings),
            sources=(self.table.source,),
        )


def _backward(table: SignalTable, time: Floats, timed: NDArray[np.bool_]) -> list[str]:
    """In words, that rows are not in order of time, and where that begins."""
    rows = np.flatnonzero(timed)
    step = np.diff(time[rows])
    back = np.flatnonzero(step < 0)
    if not len(back):
        return []
    times = f"{len(back)} time{'s' * (len(back) > 1)}"
    first = table.first_row if isinstance(table, RowTable) else 1
    return [
        f"{Path(table.source).name}: row {rows[back[0] + 1] + first}: the time goes back ({times}, "
        f"by {-step.min():g} s at most); rows are taken in order of time"
    ]


def write_signals(signals: Signals, path: str | Path, vehicle: Vehicle | None = None) -> None:
    """Write one drive in a format of ``table_formats``, with the canonical columns, or those of a
    ``vehicle`` that maps some.

    Raises ClutchestError for several drives (one file holds one) and for another suffix.
    """
    path = Path(path)
    if signals.later:
        raise ClutchestError(f"{path}: a table holds one drive, not {len(signals.drives)}")
    table = signals.to_pandas()
    if vehicle is not None:
        table = _renamed(table, vehicle)
    write_table(table, path)


def _renamed(table: pd.DataFrame, vehicle: Vehicle) -> pd.DataFrame:
    """The table with names and units of the vehicle file's ``[columns]``."""
    unit_of = {TIME: "s", **vehicle.machine.units}
    stated = dict(table.attrs["units"])
    for name, how in vehicle.columns.items():
        if name not in table.columns:
            continue
        unit = how.unit or split_header(how.column)[1] or unit_of[name]
        value = table[name].to_numpy()
        if unit == "%" and (reference := vehicle.signals[name].reference):
            value = value / reference * 100.0
        else:
            value = units.convert_reading(value, unit_of[name], unit)
        table = table.assign(**{name: value}).rename(columns={name: how.column})
        stated.pop(name, None)
        stated[how.column] = unit
    table.attrs["units"] = stated
    return table


def joined(parts: list[Signals]) -> Signals:
    """Tables of one drive, on one absolute clock, as one."""
    first = min(parts, key=lambda part: part.start_ns or 0)
    if len(parts) == 1 or first.start_ns is None:
        return first
    shift = [((part.start_ns or 0) - first.start_ns) / 1e9 for part in parts]
    signals = {}
    for name, unit in {n: s.unit for part in parts for n, s in part.items()}.items():
        pieces = [(part[name], dt) for part, dt in zip(parts, shift, strict=True) if name in part]
        signals[name] = Signal.of(
            name,
            unit,
            np.concatenate([piece.time + dt for piece, dt in pieces]),
            np.concatenate([piece.value for piece, _ in pieces]),
            np.concatenate([piece.why for piece, _ in pieces]),
        )
    rejected = sum(sum(part.counts.rejected.values()) for part in parts)
    return Signals(
        signals,
        first.start_ns,
        end=max(part.end + dt for part, dt in zip(parts, shift, strict=True)),
        counts=Counts(
            sum(part.counts.frames for part in parts),
            sum(part.counts.decoded for part in parts),
            {"no time": rejected} if rejected else {},
        ),
        warnings=tuple(w for part in parts for w in part.warnings),
        sources=tuple(s for part in parts for s in part.sources),
    )
