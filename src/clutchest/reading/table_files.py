"""Tables of decoded signals as files have them: csv, xlsx, Parquet, a measurement in MDF 4, or a
DataFrame.  What the columns mean is decided in :mod:`clutchest.reading.table_columns`."""

from __future__ import annotations

import gzip
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from clutchest.errors import ClutchestError
from clutchest.extras import required
from clutchest.reading.table_budget import check_cells, read_csv
from clutchest.signals import Floats

if TYPE_CHECKING:
    import pandas as pd

_BUS_LOGGING = re.compile(r"^(CAN|LIN|FLX|ETH|MOST)_\w*Frame$")
_EPOCH_S = 1e8  # an earlier start of a measurement is no date
_UNITS_ROW = re.compile(r"^\s*[\[(]?\s*([^\W\d][\w/°%·*²³^ .]*|-|%|°C|1/min)\s*[\])]?\s*$")


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

    def column(self, name: str) -> Cells:
        """One of the columns."""


@dataclass(frozen=True)
class Frame:
    """A table of pandas'; ``first_row`` is the number of its first row in the file."""

    source: str
    frame: pd.DataFrame
    stated: Mapping[str, str] = field(default_factory=dict)
    first_row: int = 2
    start_ns: int | None = None

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
        if pd.api.types.is_string_dtype(cells.dtype) or cells.dtype == object:
            cells = cells.replace(r"^\s*$", None, regex=True)
        value = pd.to_numeric(cells, errors="coerce").to_numpy(np.float64, na_value=np.nan)
        given = cells.notna().to_numpy()
        if not np.isfinite(value[given]).any() and given.any():
            comma = cells.astype(str).str.replace(",", ".", regex=False)
            value = pd.to_numeric(comma, errors="coerce").to_numpy(np.float64, na_value=np.nan)
        return Cells(value, given)

    def cells(self, name: str) -> pd.Series:
        """The cells of a column as they are."""
        cells = self.frame[name]
        if getattr(cells, "ndim", 1) != 1:
            raise ClutchestError(f"{self.source}: column '{name}' occurs twice")
        return cells


@dataclass(frozen=True)
class Measurement:
    """The channels of a measurement in MDF 4, each with the times of its group."""

    source: str
    path: Path
    places: Mapping[str, tuple[int, int]]
    units: Mapping[str, str]
    start_ns: int | None
    rows: int

    def column(self, name: str) -> Cells:
        """See :class:`SignalTable`."""
        group, index = self.places[name]
        try:
            with _mdf(self.path) as mdf:
                signal = mdf.get(group=group, index=index)
                if signal.samples.dtype.kind == "S":  # words for numbers, such as a gear
                    signal = mdf.get(group=group, index=index, raw=True)
        except Exception as problem:  # asammdf has no errors of its own
            words = " ".join(str(problem).split())[:200]
            raise ClutchestError(f"{self.source}: channel '{name}': {words}") from None
        if signal.samples.ndim != 1 or signal.samples.dtype.kind not in "iufb":
            raise ClutchestError(f"{self.source}: channel '{name}' holds no numbers")
        value = signal.samples.astype(np.float64)
        given = np.ones(len(value), bool)
        if signal.invalidation_bits is not None:
            given = ~np.asarray(signal.invalidation_bits, bool)
        return Cells(value, given, np.asarray(signal.timestamps, np.float64))


def is_table(path: Path) -> bool:
    """Whether the file holds decoded signals, not frames: Parquet, Excel, CSV without CAN ids, or a
    measurement without bus logging."""
    suffixes = [suffix.lower() for suffix in path.suffixes[-2:]]
    if suffixes[-1:] in ([".parquet"], [".xlsx"]):
        return True
    if suffixes[-1:] in ([".mf4"], [".mdf"]):
        return path.is_file() and measured(path)
    if ".csv" not in suffixes:
        return False
    return not _holds_frames(path)


def _holds_frames(path: Path) -> bool:
    """Whether a csv is a log of frames of some format."""
    from clutchest.can import files, log_source

    if not path.is_file():
        return False
    with log_source.opened(path) as source:
        if not source.head.strip():
            return False
        try:
            files.format_of(source)
        except ClutchestError:
            return False
    return True


def measured(path: Path) -> bool:
    """Whether an MDF file holds channels and no frames; one that cannot be read has neither."""
    required("asammdf")
    try:
        with _mdf(path) as mdf:
            names = [channel.name for group in mdf.groups for channel in group.channels]
    except Exception:  # its frames may be recovered
        return False
    return bool(names) and not any(_BUS_LOGGING.match(name) for name in names)


def load_table(given: Path | Any) -> SignalTable:
    """The table in a file, or a DataFrame of pandas, polars or Arrow.

    Raises ClutchestError for a file that is none.
    """
    if not isinstance(given, Path):
        return _of_frame("DataFrame", _as_pandas(given))
    if given.is_file() and not given.stat().st_size:
        raise ClutchestError(f"{given}: the file is empty; expected a CAN log or decoded signals")
    suffix = given.suffix.lower()
    try:
        if suffix in (".mf4", ".mdf"):
            return _measurement(given)
        if suffix == ".parquet":
            return _of_parquet(given)
        if suffix == ".xlsx":
            return _of_cells(str(given), _excel(given))
        return _of_csv(given)
    except ClutchestError:
        raise
    except Exception as problem:  # pandas and pyarrow raise whatever their parsers do
        what = str(problem).splitlines()[0] if str(problem) else type(problem).__name__
        raise ClutchestError(f"{given}: not a readable table: {what}") from None


def _as_pandas(given: Any) -> pd.DataFrame:
    """A DataFrame of whatever library as one of pandas'."""
    return given.to_pandas() if hasattr(given, "to_pandas") else given


def _of_frame(source: str, frame: pd.DataFrame, stated: Mapping[str, str] | None = None) -> Frame:
    """A DataFrame whose index is a column too, where it has a name or holds times."""
    import pandas as pd

    times = isinstance(frame.index, pd.DatetimeIndex | pd.TimedeltaIndex)
    if times or frame.index.name is not None:
        name = frame.index.name or "time"
        if name not in frame.columns:
            frame = frame.rename_axis(name).reset_index()
    of_frame = frame.attrs.get("units", {})
    units = {str(k): str(u) for k, u in of_frame.items()} if isinstance(of_frame, dict) else {}
    frame = frame.rename(columns=lambda name: str(name).strip())
    return Frame(source, frame, {**units, **(stated or {})})


def _of_parquet(path: Path) -> Frame:
    import pandas as pd
    import pyarrow.parquet as pq

    schema = pq.read_schema(path)
    if b"clutchest" in (schema.metadata or {}):
        raise ClutchestError(f"{path}: is a result of clutchest, expected a log")
    about = pq.read_metadata(path)
    check_cells(path, about.num_rows * about.num_columns)
    stated = {}
    for column in schema:
        metadata = column.metadata or {}
        unit = next((metadata[k] for k in (b"unit", b"units", b"Unit") if k in metadata), b"")
        stated[column.name] = unit.decode("utf-8", "replace")
    return _of_frame(str(path), pd.read_parquet(path), stated)


def _of_csv(path: Path) -> Frame:
    head = _head(path)
    first = head.splitlines()[0] if head.splitlines() else ""
    separator = max(",;\t", key=first.count) if first else ","
    options: dict[str, Any] = {
        "sep": separator,
        "skipinitialspace": True,
        "low_memory": False,
        "decimal": "," if separator == ";" and not _points(head) else ".",
    }
    encodings = ("utf-16",) if head.startswith("\ufeff16") else ("utf-8-sig", "latin-1")
    for encoding in encodings:
        try:
            return _of_cells(str(path), read_csv(path, {"encoding": encoding, **options}))
        except UnicodeDecodeError:
            continue
    raise ClutchestError(f"{path}: not a text in {' or '.join(encodings)}")


def _points(head: str) -> bool:
    """Whether numbers in the rows have a decimal point, not a comma."""
    rows = "\n".join(head.splitlines()[1:50])
    return len(re.findall(r"\d\.\d", rows)) > len(re.findall(r"\d,\d", rows))


def _head(path: Path) -> str:
    opener = gzip.open if path.suffix.lower() == ".gz" else open
    try:
        with opener(path, "rb") as file:
            raw: bytes = file.read(65536)
    except OSError as problem:
        raise ClutchestError(f"{path}: cannot be read: {problem}") from None
    if raw.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "\ufeff16" + raw.decode("utf-16", "replace")
    return raw.decode("utf-8", "replace")


def _excel(path: Path) -> pd.DataFrame:
    import pandas as pd

    required("openpyxl")
    return pd.read_excel(path, engine="openpyxl")


def _of_cells(source: str, frame: pd.DataFrame) -> Frame:
    """A table of text cells, whose second row may state units."""
    frame = frame.rename(columns=lambda name: str(name).strip())
    stated: dict[str, str] = {}
    if len(frame) > 1 and _is_units_row(frame):
        stated = {str(name): _bare(cell) for name, cell in frame.iloc[0].items()}
        frame = frame.iloc[1:].reset_index(drop=True)
    table = _of_frame(source, frame, stated)
    return Frame(source, table.frame, table.stated, first_row=3 if stated else 2)


def _is_units_row(frame: pd.DataFrame) -> bool:
    """Whether the first row holds words, one of them a unit, where the others hold numbers."""
    from clutchest import units

    words = [cell for cell in frame.iloc[0] if isinstance(cell, str) and cell.strip()]
    empty = sum(1 for cell in frame.iloc[0] if not isinstance(cell, str) and cell != cell)
    if not words or len(words) + empty < len(frame.columns):
        return False
    known = 0
    for word in words:
        if not _UNITS_ROW.match(word):
            return False
        try:
            units.parse(_bare(word))
        except ClutchestError:
            continue
        known += 1
    return 2 * known >= len(words)


def _bare(cell: Any) -> str:
    return cell.strip().strip("[]()").strip() if isinstance(cell, str) else ""


def _mdf(path: Path) -> Any:
    from asammdf import MDF

    from clutchest.can.log_source import quiet
    from clutchest.can.recovery.mf4_links import check_links

    with path.open("rb") as file:
        check_links(path, file)
    with quiet("asammdf"):
        options: dict[str, Any] = {"process_bus_logging": False}
        return MDF(path, **options)


def _measurement(path: Path) -> Measurement:
    places: dict[str, tuple[int, int]] = {}
    stated: dict[str, str] = {}
    rows = 0
    with _mdf(path) as mdf:
        masters = mdf._mdf.masters_db
        for number, group in enumerate(mdf.groups):
            cycles = group.channel_group.cycles_nr
            rows = max(rows, cycles)
            check_cells(path, cycles)
            for index, channel in enumerate(group.channels):
                if not cycles or masters.get(number) == index or channel.name in places:
                    continue
                places[channel.name] = (number, index)
                conversion = channel.conversion
                stated[channel.name] = channel.unit or (conversion.unit if conversion else "")
        start_s = mdf.header.start_time.timestamp()
    if not places:
        raise ClutchestError(f"{path}: no channel with samples")
    absolute = start_s > _EPOCH_S
    start_ns = round(start_s * 1e6) * 1000 if absolute else None
    return Measurement(str(path), path, places, stated, start_ns, rows)
