"""Already decoded signals: CSV and Parquet with canonical columns, in and out."""

from __future__ import annotations

import gzip
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from clutchest.errors import ClutchestError, nearest
from clutchest.signals import Counts, Floats, Signal, Signals

if TYPE_CHECKING:
    import pandas as pd

_EPOCH = 1e8  # s; times beyond are stamps since 1970


def is_table(path: Path) -> bool:
    """Whether the file holds decoded signals, not frames: Parquet, or CSV without CAN ids."""
    suffixes = [suffix.lower() for suffix in path.suffixes[-2:]]
    if suffixes[-1:] == [".parquet"]:
        return True
    if ".csv" not in suffixes:
        return False
    return "arbitration_id" not in _header(path)


def _header(path: Path) -> str:
    opener = gzip.open if path.suffix.lower() == ".gz" else open
    try:
        with opener(path, "rb") as file:
            return file.readline(65536).decode("latin-1")
    except OSError as problem:
        raise ClutchestError(f"{path}: cannot be read: {problem}") from None


def read_table(path: Path, columns: Mapping[str, str]) -> Signals:
    """The canonical signals in a table; ``columns`` are the names known, with their units.

    One row per time stamp, an empty cell where a signal has no sample.  ``time`` in s is taken as
    given, unless it is the time since 1970.  Cells that are no numbers are rejected one by
    one, rows without a time whole.  Raises ClutchestError if ``time`` or every known column is
    missing.
    """
    import pyarrow

    table = _load(path)
    if "time" not in table.columns:
        raise ClutchestError(
            f"{path}: no column 'time' (s); it has " + ", ".join(map(str, table.columns[:8]))
        )
    names = [name for name in table.columns if name in columns]
    unknown = [str(name) for name in table.columns if name not in columns and name != "time"]
    if not names:
        hint = nearest(unknown[0], columns) if unknown else ""
        raise ClutchestError(
            f"{path}: no known signal among its columns: "
            f"{', '.join(unknown[:8]) or 'none at all'}{hint}"
        )
    warnings = [
        f"{path.name}: column '{name}' ignored" + nearest(name, columns) for name in unknown
    ]
    numbers = {name: _numbers(path, table, name, warnings) for name in ("time", *names)}
    time, timed = numbers["time"][0], np.isfinite(numbers["time"][0])
    if not timed.any():
        reason = "".join(f"; {warning}" for warning in warnings[-1:])
        raise ClutchestError(f"{path}: no row with a time in s{reason}")
    rejected = {"no time": int((~timed).sum())} if not timed.all() else {}
    start = float(time[timed].min())
    absolute = start > _EPOCH
    warnings += _backward(path, time, timed)
    if start < 0:
        warnings.append(f"{path.name}: time begins at {start:g} s; counted from there")
    time = time - start if absolute or start < 0 else time

    signals, useful = {}, np.zeros(len(time), bool)
    for name in names:
        value, given = numbers[name]
        rows = given & timed
        when = time if rows.all() else time[rows]
        signals[name] = Signal.of(name, columns[name], when, value[rows])
        useful |= rows & np.isfinite(value)
        if not rows.any():
            warnings.append(f"{path.name}: column '{name}' is empty")
    del table, numbers, value
    pyarrow.default_memory_pool().release_unused()  # else it keeps what reading took
    return Signals(
        signals,
        start_ns=round(start * 1e9) if absolute else None,
        end=float(time[timed].max()),
        counts=Counts(len(time), int(useful.sum()), rejected),
        warnings=tuple(warnings),
        sources=(str(path),),
    )


def _backward(path: Path, time: Floats, timed: NDArray[np.bool_]) -> list[str]:
    """In words, that rows are not in order of time, and where that begins."""
    rows = np.flatnonzero(timed)
    step = np.diff(time[rows])
    back = np.flatnonzero(step < 0)
    if not len(back):
        return []
    times = f"{len(back)} time{'s' * (len(back) > 1)}"
    return [
        f"{path.name}: row {rows[back[0] + 1] + 2}: the time goes back ({times}, by "
        f"{-step.min():g} s at most); rows are taken in order of time"
    ]


def _load(path: Path) -> pd.DataFrame:
    import pandas as pd

    if path.is_file() and not path.stat().st_size:
        raise ClutchestError(f"{path}: the file is empty; expected a CAN log or decoded signals")
    try:
        if path.suffix.lower() == ".parquet":
            _no_result(path)
            return _in_seconds(pd.read_parquet(path))
        separator = ";" if _header(path).count(";") > _header(path).count(",") else ","
        options = {
            "sep": separator,
            "skipinitialspace": True,
            "low_memory": False,
            "decimal": "," if separator == ";" else ".",
        }
        try:
            table = pd.read_csv(path, encoding="utf-8-sig", **options)
        except UnicodeDecodeError:
            table = pd.read_csv(path, encoding="latin-1", **options)
    except ClutchestError:
        raise
    except Exception as problem:  # pandas and pyarrow raise whatever their parsers do
        what = str(problem).splitlines()[0] if str(problem) else type(problem).__name__
        raise ClutchestError(f"{path}: not a readable table: {what}") from None
    return table.rename(columns=lambda name: str(name).strip())


def _no_result(path: Path) -> None:
    """Raises ClutchestError for estimates and truths, which bear the version that made them."""
    import pyarrow.parquet as pq

    if b"clutchest" in (pq.read_schema(path).metadata or {}):
        raise ClutchestError(f"{path}: is a result of clutchest, expected a log")


def _in_seconds(table: pd.DataFrame) -> pd.DataFrame:
    """The table with dates (UTC unless they have a zone) or spans in ``time`` as s."""
    import pandas as pd

    if table.index.name == "time" and "time" not in table.columns:
        table = table.reset_index()
    if "time" not in table.columns or isinstance(table["time"], pd.DataFrame):
        return table
    time = table["time"]
    if isinstance(time.dtype, pd.DatetimeTZDtype):
        time = time.dt.tz_convert("UTC").dt.tz_localize(None)
    if pd.api.types.is_datetime64_dtype(time):
        time = time - pd.Timestamp(0)
    if pd.api.types.is_timedelta64_dtype(time):
        table = table.assign(time=time / pd.Timedelta(seconds=1))
    return table


def _numbers(
    path: Path, table: pd.DataFrame, name: str, warnings: list[str]
) -> tuple[np.ndarray, np.ndarray]:
    """(value, given): NaN where a cell is no number, ``given`` where it is not empty."""
    import pandas as pd

    column = table[name]
    if isinstance(column, pd.DataFrame):
        raise ClutchestError(f"{path}: column '{name}' occurs twice")
    value = pd.to_numeric(column, errors="coerce").to_numpy(np.float64, na_value=np.nan)
    given = column.notna().to_numpy()
    wrong = np.flatnonzero(given & np.isnan(value))
    if len(wrong):
        warnings.append(
            f"{path.name}: row {wrong[0] + 2}: {name} '{column.iloc[wrong[0]]}' is not "
            f"a number ({len(wrong)} such cells)"
        )
    return value, given


def to_table(signals: Signals) -> pd.DataFrame:
    """One drive as a table: ``time`` and a column per signal, one row per time stamp.

    Invalid samples are empty cells; of two samples of a signal at one time the later one counts.
    """
    import pandas as pd

    valid = {name: signal.only_valid() for name, signal in signals.items()}
    times = [signal.time for signal in signals.values()]
    time = np.unique(np.concatenate(times)) if times else np.zeros(0)
    columns = {"time": time}
    for name, signal in valid.items():
        column = np.full(len(time), np.nan)
        column[np.searchsorted(time, signal.time)] = signal.value
        columns[name] = column
    return pd.DataFrame(columns)


def write_signals(signals: Signals, path: str | Path) -> None:
    """Write one drive as ``.csv``, ``.csv.gz`` or ``.parquet`` with the canonical columns.

    Raises ClutchestError for several drives (one file holds one) and for another suffix.
    """
    path = Path(path)
    if signals.later:
        raise ClutchestError(f"{path}: a table holds one drive, not {len(signals.drives)}")
    table = to_table(signals)
    if path.suffix.lower() == ".parquet":
        table.to_parquet(path, index=False)
    elif path.name.lower().endswith((".csv", ".csv.gz")):
        table.to_csv(path, index=False)
    else:
        raise ClutchestError(f"{path}: decoded signals are written as .csv or .parquet")


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
