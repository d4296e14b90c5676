"""What the columns of a table are: canonical signals, their units, and the time."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from clutchest import units
from clutchest.can.time_stamps import LAST_S
from clutchest.errors import ClutchestError, nearest
from clutchest.reading.signal_table import DATA_FRAME, Cells, Frame, RowTable, SignalTable
from clutchest.reading.written_times import written_times
from clutchest.shown import counted
from clutchest.signals import Floats
from clutchest.vehicle import TableColumn

if TYPE_CHECKING:
    import pandas as pd

TIME = "time"
_TIMES = (
    *("time", "t", "timestamp", "timestamps", "clock", "time_of_day"),
    *("zeit", "zeitstempel", "uhrzeit", "temps", "tiempo", "tempo"),
)
_DATES = ("date", "datetime", "date_time", "datum", "utc")
_HEADER = re.compile(r"^(?P<name>.*?\S)\s*(?P<mark>[\[(])\s*(?P<unit>[^\[\]()]*)\s*[\])]$")
_LEFT = "(l)"  # as often the left one of two as litres
_TIME_SUFFIX = re.compile(r"^(t|time|timestamp|zeit)_(s|ms|us|ns)$", re.IGNORECASE)
_SUFFIXES = {  # of names such as engine_speed_rpm
    "rpm": "rpm",
    "rad_s|radps|rads": "rad/s",
    "km_h|kmh|kph|kmph": "km/h",
    "m_s|mps": "m/s",
    "nm": "Nm",
    "mm": "mm",
    "deg_?c|celsius": "°C",
    "deg_?f|fahrenheit": "°F",
    "kelvin": "K",
    "pct|percent": "%",
}
_SUFFIX = re.compile(rf"^(.*\S)_({'|'.join(_SUFFIXES)})$", re.IGNORECASE)
_TEMPERATURE = re.compile(r"^(.*temp.*)_([CFK])$")  # single letters may mean anything else
_DAY_S = 86_400.0
_NS = {"s": 1e9, "ms": 1e6, "us": 1e3, "µs": 1e3, "ns": 1.0, "sec": 1e9, "seconds": 1e9}
_NS |= {"min": 60e9, "h": 3600e9} | dict.fromkeys(("d", "day", "days"), 1e9 * _DAY_S)
_EPOCH = ((1e17, 1e-9), (1e14, 1e-6), (1e11, 1e-3))  # stamps since 1970 beyond, and their unit, s
_DAYS = (  # first and last of such numbers, their 1970-01-01, and who counts so
    (30_000.0, 55_000.0, 25_569.0, "as Excel counts them"),
    (700_000.0, 770_000.0, 719_529.0, "as MATLAB counts them"),
    (0.0, 2.0, 0.0, "parts of a day, as Excel has a time of day"),
)
_TIMES_READ = (
    "; expected s, dates such as 2024-02-29 23:59:59.5 or 29.02.2024 23:59:59.5, or times of day"
)
_DAY_STEP = 5e-5  # from time to time, below which numbers are no seconds (20 kHz) but days (4 s)


@dataclass(frozen=True, slots=True)
class Place:
    """A column that holds a signal, and its unit there."""

    column: str
    unit: str


def split_header(header: str) -> tuple[str, str]:
    """(name, unit) of a header such as ``engine_speed [rpm]`` or ``engine_speed_rpm``; no unit
    where none is known.  What square brackets hold is a unit, whether it is known or not."""
    written = header.strip()
    match = _HEADER.match(written)
    unit = match["unit"].strip() if match else ""
    is_one = _is_unit(unit) and not written.lower().endswith(_LEFT)
    if match and unit and (match["mark"] == "[" or is_one):
        return match["name"].strip(), unit
    if ended := _TIME_SUFFIX.match(written):
        return ended[1], ended[2]
    if ended := _SUFFIX.match(written):
        known = _SUFFIXES.items()
        return ended[1], next(u for p, u in known if re.fullmatch(p, ended[2], re.IGNORECASE))
    if ended := _TEMPERATURE.match(written):
        return ended[1], {"C": "°C", "F": "°F", "K": "K"}[ended[2]]
    return written, ""


def is_time(header: str) -> bool:
    """Whether a column of this name holds the times."""
    return _plain(split_header(header)[0]) in (*_TIMES, *_DATES)


def _is_unit(text: str) -> bool:
    return text.strip().lower() in _NS or _unit(text) is not None


def _unit(text: str) -> units.Unit | None:
    try:
        return units.parse(text)
    except ClutchestError:
        return None


def places(
    table: SignalTable, wanted: Mapping[str, str], mapped: Mapping[str, TableColumn]
) -> dict[str, Place]:
    """Canonical name → its column.  ``wanted``: canonical names with their units; ``mapped``: the
    columns that a vehicle file names, instead of which the canonical ones may be there.

    Raises ClutchestError for a unit that measures something else.
    """
    headers = {header: split_header(header) for header in table.units}
    found: dict[str, Place] = {}
    for name, unit in wanted.items():
        how = mapped.get(name)
        header = header_of(how.column if how else name, headers)
        if header is None and how:  # a table that ``convert`` wrote has canonical names
            how, header = None, header_of(name, headers)
        if header is None:
            continue
        stated = (how.unit if how else "") or headers[header][1] or table.units[header]
        found[name] = Place(header, _checked(table, header, name, stated, unit))
    return found


def header_of(name: str, headers: Mapping[str, tuple[str, str]]) -> str | None:
    """The header that is ``name``, where it must be without unit and case, and with blanks, points,
    hyphens or capitals for underscores."""
    if name in headers:
        return name
    for plain in (str.lower, _plain):
        for header, (base, _) in headers.items():
            if plain(base) == plain(name):
                return header
    return None


def _plain(name: str) -> str:
    return re.sub(r"[\s.\-]+|(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()


def _checked(table: SignalTable, header: str, name: str, stated: str, unit: str) -> str:
    """The unit of a column, which must measure what ``name`` does; percent may be of a torque."""
    if not stated:
        return unit
    try:
        fits = stated == "K" or units.compatible(stated, unit)
    except ClutchestError as problem:
        raise ClutchestError(
            f"{table.source}: column '{header}': {problem}; [columns] of the vehicle file states "
            f'it: {name} = {{ column = "{header}", unit = "{unit}" }}'
        ) from None
    if fits or stated == "%":
        return stated
    raise ClutchestError(
        f"{table.source}: column '{header}' is in {stated}, expected a unit of {name}, such as "
        f"{unit}"
    )


def missing_words(
    table: SignalTable, found: Mapping[str, Place], mapped: Mapping[str, TableColumn]
) -> Iterator[str]:
    """Of columns that the vehicle file names and the table does not have."""
    for name, how in mapped.items():
        if name not in found and name != TIME:
            hint = nearest(how.column, table.units)
            yield f"{table.source}: no column '{how.column}' ({name}){hint}"


def contrary_words(table: SignalTable, found: Mapping[str, Place]) -> Iterator[str]:
    """Of columns whose header states another unit than the vehicle file, which is the one taken."""
    for place in found.values():
        own = split_header(place.column)[1] or table.units[place.column]
        if own and _unit(own) not in (None, _unit(place.unit)):
            yield (
                f"{_file(table)}: column '{place.column}' states {own}, the vehicle file "
                f"{place.unit}, which is taken"
            )


@dataclass(frozen=True, slots=True)
class Clock:
    """The ``time`` (n,) of a table's rows, s, NaN where there is none; from ``start_ns`` on where
    it is absolute; ``column`` its name."""

    time: Floats
    start_ns: int | None
    column: str
    warnings: tuple[str, ...] = ()


def clock_of(table: RowTable, mapped: Mapping[str, TableColumn]) -> Clock:
    """The times of the rows.  Raises ClutchestError where there is no column of them."""
    column, unit = _time_column(table, mapped)
    seconds, warnings = _seconds(table, column, unit)
    beyond = int(np.count_nonzero(np.abs(seconds) > LAST_S))
    if beyond:
        seconds = np.where(np.abs(seconds) > LAST_S, np.nan, seconds)
        warnings.append(f"{_file(table)}: {beyond} times beyond {LAST_S:g} s, which are not used")
    known = np.isfinite(seconds)
    if not known.any():
        reason = "".join(f"; {warning}" for warning in warnings[-1:])
        raise ClutchestError(f"{table.source}: no row with a time in s{reason}{_TIMES_READ}")
    start = float(seconds[known].min())
    absolute = start > 1e8
    if absolute:
        seconds = seconds - start
    if absolute:  # a number of 64 bits holds s since 1970 to a quarter of a microsecond
        seconds = np.round(seconds, 6)
    return Clock(seconds, round(start * 1e9) if absolute else None, column, tuple(warnings))


def _time_column(table: RowTable, mapped: Mapping[str, TableColumn]) -> tuple[str, str]:
    """(header, unit) of the column of times."""
    headers = {header: split_header(header) for header in table.units}
    how = mapped.get(TIME)
    if how and (header := header_of(how.column, headers)) is not None:
        return header, how.unit or headers[header][1] or table.units[header]
    for names in (_TIMES, _DATES):
        for name in names:
            if (header := header_of(name, headers)) is not None:
                return header, headers[header][1] or table.units[header]
    if how:
        hint = nearest(how.column, table.units)
        raise ClutchestError(f"{table.source}: no column '{how.column}' (time){hint}")
    index = " or index" * (table.source == DATA_FRAME)
    raise ClutchestError(
        f"{table.source}: no column{index} of times, expected one named {', '.join(_TIMES)}, or of "
        f"dates, named {', '.join(_DATES)}; it has {', '.join(list(table.units)[:8])}"
    )


def _seconds(table: RowTable, column: str, unit: str) -> tuple[Floats, list[str]]:
    """Times in s, of numbers, dates or spans; in words, what cannot be read."""
    if isinstance(table, Frame) and (times := _typed_times(table.cells(column))) is not None:
        return times, []
    numbers = table.column(column)
    if isinstance(table, Frame) and numbers.given.any() and not np.isfinite(numbers.value).any():
        times = written_times(table.cells(column), table.source)
        if times is not None:
            return times, []
    words = not_numbers(table, column, column, numbers)
    scale = _unit_s(table, column, unit, numbers)
    zero = 0.0
    if (not unit or scale == _DAY_S) and (days := _days(numbers.value, scale == _DAY_S)):
        zero, how = days
        if not unit:
            words.append(f"{_file(table)}: {column} is taken for days, {how}")
            scale = _DAY_S
    with np.errstate(over="ignore", invalid="ignore"):  # of numbers that are no times
        return (numbers.value - zero) * scale, words


def _typed_times(cells: pd.Series) -> Floats | None:
    """Seconds of cells that pandas knows as dates or spans; None of others."""
    import pandas as pd

    if isinstance(cells.dtype, pd.DatetimeTZDtype):
        cells = cells.dt.tz_convert("UTC").dt.tz_localize(None)
    if pd.api.types.is_datetime64_dtype(cells):
        cells = cells - pd.Timestamp(0)
    if pd.api.types.is_timedelta64_dtype(cells):
        return (cells / pd.Timedelta(seconds=1)).to_numpy(np.float64)
    return None


def _days(value: Floats, stated: bool) -> tuple[float, str] | None:
    """(their 1970-01-01, who counts so) of numbers that are days: so ``stated``, or too close to
    each other to be seconds."""
    known = value[np.isfinite(value)]
    first, last = float(known.min(initial=np.inf)), float(known.max(initial=-np.inf))
    if not (stated or last - first < _DAY_STEP * (len(known) - 1)):
        return None  # whether or not some are the same
    known = np.unique(known)
    if len(known) < 2 or not (stated or known[-1] - known[0] < _DAY_STEP * (len(known) - 1)):
        return None
    counts = (row for row in _DAYS if row[0] <= known[0] and known[-1] <= row[1])
    return next(((zero, how) for _, _, zero, how in counts), None)


def _unit_s(table: RowTable, column: str, unit: str, numbers: Cells) -> float:
    """The unit of a column of times, s: as stated, else by the size of stamps since 1970."""
    known = numbers.value[np.isfinite(numbers.value)]
    if unit:
        if unit.lower() in _NS:
            return _NS[unit.lower()] / 1e9
        try:
            return units.convert(1.0, unit, "s")
        except ClutchestError as problem:
            raise ClutchestError(f"{table.source}: column '{column}': {problem}") from None
    first = float(np.abs(known).min(initial=np.inf))
    return next((factor for least, factor in _EPOCH if first >= least and len(known)), 1.0)


def not_numbers(table: RowTable, header: str, name: str, column: Cells) -> list[str]:
    """In words, the first cell of a column that is no number, and how many there are."""
    wrong = np.flatnonzero(column.given & np.isnan(column.value))
    if not (len(wrong) and isinstance(table, Frame)):
        return []
    row = wrong[0] + table.first_row
    return [
        f"{_file(table)}: row {row}: {name} '{table.cells(header).iloc[wrong[0]]}' is not a number "
        f"({counted(len(wrong), 'such cell')})"
    ]


def _file(table: SignalTable) -> str:
    """The file's name without its folder."""
    return re.split(r"[/\\]", table.source)[-1]
