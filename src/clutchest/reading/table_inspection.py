"""An unknown table of decoded signals: its columns, and a vehicle file drafted from them."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from clutchest import units
from clutchest.errors import ClutchestError
from clutchest.models import machine_in_file, machine_of, shipped_machines
from clutchest.models.machine import Machine
from clutchest.models.thresholds import Thresholds
from clutchest.paths import names_of
from clutchest.reading.candidates import noise_of
from clutchest.reading.drafting import (
    guessed_parameters,
    origin_of_parameters,
    percents_in_words,
)
from clutchest.reading.signal_table import RowTable, SignalTable
from clutchest.reading.table_columns import TIME, clock_of, not_numbers, split_header
from clutchest.reading.table_formats import load_table
from clutchest.reading.table_units import (
    STATE_PERCENT,
    by_guess,
    likely_unit,
    may_be_percent,
)
from clutchest.shipped import locate_each
from clutchest.vehicle import (
    BusSignal,
    SignalMap,
    TableColumn,
    Vehicle,
    dump_vehicle,
    load_vehicle,
)

MOST_COLUMNS = 500  # of which values are read
SLOWEST_S = 0.5  # between rows; larger steps are of ms
GAP_PERIODS = 3.0  # of the slowest column, that a gap may last in the drafted file


@dataclass(frozen=True, slots=True)
class ColumnStatistics:
    """One column: its ``unit`` as far as the table states it, ``count`` numbers from ``low`` to
    ``high``, None without any; ``step`` the smallest difference, None where no number occurs twice,
    as of an angle that grows; ``period_s`` between numbers, and their ``scatter`` about their
    neighbours."""

    column: str
    unit: str
    count: int
    low: float | None
    high: float | None
    step: float | None
    period_s: float | None
    scatter: float = 0.0


@dataclass(frozen=True, slots=True)
class TableInspection:
    """Columns of tables and the signals of a machine among them, the most likely first."""

    logs: tuple[Path, ...]
    duration_s: float
    columns: tuple[ColumnStatistics, ...]
    candidates: Mapping[str, tuple[ColumnStatistics, ...]]
    time: TableColumn | None
    warnings: tuple[str, ...]
    machine: Machine
    model_file: Path | None = None

    @property
    def origin(self) -> tuple[str, ...]:
        """Where the drafted numbers are from, and what would determine them."""
        return origin_of_parameters(self.machine, self.machine.template)

    @property
    def missing(self) -> tuple[str, ...]:
        """What the drafted vehicle file lacks, in words."""
        words = [
            f"columns.{column.name} ({column.unit}): no column has a matching name and unit"
            + self._in_unit(column.unit)
            for column in self.machine.lacking(self.candidates)
        ]
        if not self.machine.template:
            words += [f"parameters.{p.key} ({p.unit}): {p.what}" for p in self.machine.parameters]
        return tuple(words)

    def _in_unit(self, unit: str) -> str:
        """Which columns that are not taken have a unit that fits, in words."""
        taken = {each.column for found in self.candidates.values() for each in found}
        fitting = [
            c.column
            for c in self.columns
            if c.column not in taken and c.unit and _fits(c.unit, unit)
        ]
        words = f"; in such a unit: {', '.join(fitting)}" if fitting else ""
        if units.compatible(unit, "%"):
            return words
        return words + percents_in_words(
            c.column
            for c in self.columns
            if c.column not in taken and c.unit == "%" and c.low != c.high
        )

    def as_dict(self) -> dict[str, Any]:
        """What ``inspect.json`` holds."""
        return {
            "logs": [str(path) for path in self.logs],
            "duration_s": self.duration_s,
            "columns": [asdict(column) for column in self.columns],
            "signals": {
                name: [asdict(column) for column in columns]
                for name, columns in self.candidates.items()
            },
            "missing": list(self.missing),
            "nearest_vehicle": self.machine.template or None,
            "warnings": list(self.warnings),
        }

    def write_vehicle(self, path: Path, target: Path) -> None:
        """A vehicle file at ``path`` that will lie at ``target``: the most likely columns, and the
        parameters of the machine's template as guesses."""
        like = load_vehicle(self.machine.template).signals if self.machine.template else {}
        columns: dict[str, TableColumn] = {} if self.time is None else {TIME: self.time}
        signals = {}
        for name, found in self.candidates.items():
            unit = found[0].unit or self.machine.units[name]
            columns[name] = TableColumn(found[0].column, unit)
            signals[name] = self._map(name, found[0], unit, like.get(name))
        model = self.model_file.name if self.model_file else self.machine.name
        vehicle = Vehicle(
            re.sub(r"\W+", "_", self.logs[0].name.split(".")[0]),
            model,
            target,
            "",
            (),
            signals,
            guessed_parameters(self.machine),
            modes={"gap": self._gap} if self._gap else {},
            model_file=self.model_file,
            columns=columns,
        )
        dump_vehicle(vehicle, path, self._heading(), target)

    @property
    def _gap(self) -> float:
        """The longest gap, s, that is to be bridged, where samples are further apart than it is
        for other logs; else 0."""
        used = [found[0].period_s or 0.0 for found in self.candidates.values()]
        slowest = max(used, default=0.0)
        return float(f"{GAP_PERIODS * slowest:.3g}") if slowest > Thresholds().gap else 0.0

    def _map(
        self, name: str, found: ColumnStatistics, unit: str, like: SignalMap | None
    ) -> SignalMap:
        canonical = self.machine.units[name]
        scale = abs(units.parse(unit).scale / units.parse(canonical).scale)
        shown = max((found.step or 0.0) / np.sqrt(12.0), 0.0 if like else found.scatter)
        noise = max(like.noise if like else 0.0, float(f"{shown * scale:.3g}")) or 1.0
        whose = f"the shipped {self.machine.template}'s" if like else "the column's scatter"
        ar = like.noise_ar if like else 0.0
        return SignalMap(
            name,
            BusSignal("", "", unit),
            noise,
            noise_ar=ar,
            noise_source=f"guess: {whose}, or the column's own steps",
            period=float(f"{found.period_s:.3g}") if found.period_s and self._gap else None,
        )

    def _heading(self) -> str:
        lines = [
            f"Drafted by `clutchest inspect` from {names_of(self.logs)}.",
            "Every parameter is a guess; see the `source` of each.",
            *(f"MISSING {what}" for what in self.missing),
            *self.origin,
        ]
        lines += [
            f"{name}: also possible: {column.column}"
            for name, columns in self.candidates.items()
            for column in columns[1:4]
        ]
        return "\n".join(lines)


@np.errstate(all="ignore")  # a file may hold any number
def inspect_tables(paths: Sequence[str | Path], model: str = "") -> TableInspection:
    """Survey tables and search for the canonical signals of a machine, by name and unit.

    ``model`` as :func:`~clutchest.reading.inspection.inspect_logs` has it.  Raises ClutchestError
    for a file that cannot be read.
    """
    model_file = Path(model).resolve() if model.endswith(".py") else None
    asked = machine_in_file(model_file) if model_file else machine_of(model) if model else None
    logs = tuple(locate_each(map(str, paths), "logs"))
    columns: dict[str, ColumnStatistics] = {}
    warnings: list[str] = []
    duration, time = 0.0, None
    for path in logs:
        surveyed = _surveyed(load_table(path), warnings)
        columns = {**surveyed.columns, **columns}
        duration += surveyed.duration_s
        time = time or surveyed.time
    machines = [asked] if asked else shipped_machines()
    searched = [(_search(list(columns.values()), machine), machine) for machine in machines]
    candidates, machine = max(searched, key=lambda each: len(each[0]))
    candidates = _with_units(candidates, [load_table(path) for path in logs], machine, warnings)
    every = tuple(columns.values())
    return TableInspection(
        logs, duration, every, candidates, time, tuple(warnings), machine, model_file
    )


@dataclass(frozen=True, slots=True)
class _Surveyed:
    columns: Mapping[str, ColumnStatistics]
    duration_s: float
    time: TableColumn | None


def _surveyed(table: SignalTable, warnings: list[str]) -> _Surveyed:
    """Statistics of the columns of a table, and its column of times where that needs naming."""
    clock = clock_of(table, {}) if isinstance(table, RowTable) else None
    columns: dict[str, ColumnStatistics] = {}
    duration = 0.0
    for header in list(table.units)[:MOST_COLUMNS]:
        if clock is not None and header == clock.column:
            continue
        _, unit = split_header(header)
        try:
            column = table.column(header)
        except ClutchestError as problem:
            if isinstance(table, RowTable):  # else a channel of words
                warnings.append(str(problem))
            continue
        if isinstance(table, RowTable):
            wrong = not_numbers(table, header, header, column)
            if wrong and not np.isfinite(column.value).any():
                continue
            warnings += wrong
        times = column.time if clock is None else clock.time
        assert times is not None
        known = np.isfinite(column.value) & column.given & np.isfinite(times)
        value, when = column.value[known], np.sort(times[known])
        duration = max(duration, float(np.ptp(when)) if len(when) else 0.0)
        distinct = np.unique(value)
        steps = np.diff(distinct[: 0 if len(distinct) == len(value) else None])
        columns[header] = ColumnStatistics(
            header,
            unit or table.units[header],
            len(value),
            float(value.min()) if len(value) else None,
            float(value.max()) if len(value) else None,
            float(steps.min()) if len(steps) else None,
            float(np.median(np.diff(when))) if len(when) > 1 else None,
            noise_of(value),
        )
    left = len(table.units) - MOST_COLUMNS
    if left > 0:
        warnings.append(f"{Path(table.source).name}: {left} more columns are not looked at")
    if clock is None:
        return _Surveyed(columns, duration, None)
    header, unit = split_header(clock.column)
    times = np.sort(clock.time[np.isfinite(clock.time)])
    slow = len(times) > 1 and float(np.median(np.diff(times))) > SLOWEST_S
    if slow and not unit and not table.units[clock.column] and clock.start_ns is None:
        warnings.append(f"column '{clock.column}' states no unit; by its steps it is in ms")
        columns = {k: replace(c, period_s=(c.period_s or 0.0) / 1e3) for k, c in columns.items()}
        return _Surveyed(columns, duration / 1e3, TableColumn(clock.column, "ms"))
    place = TableColumn(clock.column) if header.lower() != TIME else None
    return _Surveyed(columns, duration, place)


def _search(
    columns: Sequence[ColumnStatistics], machine: Machine
) -> dict[str, tuple[ColumnStatistics, ...]]:
    """Canonical name → the columns that may be it: those that vary and are named so first."""
    found: dict[str, tuple[ColumnStatistics, ...]] = {}
    for column in machine.columns:
        named = column.named or rf"^{re.escape(column.name)}$"
        fitting = []
        for each in columns:
            name = re.sub(r"[\s.\-]+", "_", split_header(each.column)[0])
            exact = name.lower() == column.name
            if (exact or re.search(named, name, re.IGNORECASE)) and _fits(each.unit, column.unit):
                varies = each.low is not None and each.high != each.low
                fitting.append((exact, varies, each.count, each))
        if fitting:
            fitting.sort(key=lambda item: item[:3], reverse=True)
            found[column.name] = tuple(each for *_, each in fitting)
    return found if machine.template else found | _only_ones(columns, machine, found)


def _only_ones(
    columns: Sequence[ColumnStatistics],
    machine: Machine,
    found: Mapping[str, tuple[ColumnStatistics, ...]],
) -> dict[str, tuple[ColumnStatistics, ...]]:
    """Canonical name → the column, where of what is not ``found`` by name both are the only ones in
    such a unit: a machine of the user's own says nothing of names on a bus."""
    taken = {each.column for candidates in found.values() for each in candidates}
    left = [c for c in columns if c.column not in taken and c.unit]
    wanted = [signal for signal in machine.columns if signal.name not in found]
    only: dict[str, tuple[ColumnStatistics, ...]] = {}
    for signal in wanted:
        fitting = [c for c in left if _fits(c.unit, signal.unit)]
        rivals = [each for each in wanted if _fits(each.unit, signal.unit)]
        if len(fitting) == len(rivals) == 1:
            only[signal.name] = (fitting[0],)
    return only


def _with_units(
    candidates: Mapping[str, tuple[ColumnStatistics, ...]],
    tables: Sequence[SignalTable],
    machine: Machine,
    warnings: list[str],
) -> dict[str, tuple[ColumnStatistics, ...]]:
    """The candidates with the likeliest unit where the table states none."""
    template = load_vehicle(machine.template) if machine.template else None
    given: dict[str, tuple[ColumnStatistics, ...]] = {}
    taken: list[str] = []
    for name, found in candidates.items():
        column, first = machine.column(name), found[0]
        if template is None or column is None or first.unit:
            given[name] = found
            continue
        table = next(table for table in tables if first.column in table.units)
        value = table.column(first.column).value
        value = value[np.isfinite(value)]
        unit = likely_unit(value, column, template)
        if column.magnitude is not None and column.magnitude.of and may_be_percent(value):
            warnings.append(
                f"column '{first.column}' states no unit and reads like percentages: "
                f"{STATE_PERCENT}"
            )
        elif unit != column.unit:
            warnings.append(
                f"column '{first.column}' states no unit; by its values it is in {unit}"
            )
        elif by_guess(column) and split_header(first.column)[0].lower() != name:
            taken.append(f"{first.column} ({unit})")
        given[name] = (replace(first, unit=unit), *found[1:])
    if taken:
        warnings.append(
            f"no unit is stated and values do not show it, taken for granted: {', '.join(taken)}; "
            "`unit` under [columns] states another one"
        )
    return given


def _fits(unit: str, canonical: str) -> bool:
    """Whether a column in ``unit`` may be a signal; percent is none without what it is of."""
    try:
        return not unit or unit == "K" or units.compatible(unit, canonical)
    except ClutchestError:  # a unit that only this table knows
        return False
