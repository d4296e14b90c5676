"""A measurement in MDF 4 (ASAM): every column a channel with its unit and comment.

A drive is a group of channels with one time; a column with empty cells is a group of its own, with
the times at which it has a value.  Names (the mode, the log) are numbers with a table of texts.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from datetime import UTC, datetime
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from clutchest.errors import ClutchestError
from clutchest.extras import required
from clutchest.reading.drives_in_table import drives_of
from clutchest.reading.signal_table import Cells, Channels
from clutchest.reading.table_budget import check_cells
from clutchest.reading.table_kind import TableKind

if TYPE_CHECKING:
    import pandas as pd

_BUS_LOGGING = re.compile(r"^(CAN|LIN|FLX|ETH|MOST)_\w*Frame$")
_OLDER = re.compile(rb"MDF {5}([23]\.\d\d)")
_EPOCH_S = 1e8  # an earlier start of a measurement is no date
_LAST_NUMBER = 5  # cn_data_type: integers and floating point
_OF_VARYING_LENGTH = (1, 5)  # cn_type
_NO_NUMBERS = ValueError("holds no numbers")


def write(table: pd.DataFrame, path: Path) -> None:
    """Write ``table``; times count from the file's start, which is that of the first drive."""
    required("asammdf")
    from asammdf import MDF

    drives = drives_of(table)
    known = [start for _, start in drives if start is not None]
    with MDF(version="4.10") as mdf:
        if known:
            mdf.start_time = datetime.fromtimestamp(min(known) / 1e9, UTC)
        for number, (rows, start) in enumerate(drives):
            shift = 0.0 if start is None else (start - min(known)) / 1e9
            name = f"drive {number}" if len(drives) > 1 else "table"
            whole, parts = _channels(rows, rows["time"].to_numpy(np.float64) + shift, table.attrs)
            for group in (whole, *([part] for part in parts)):
                if group:
                    mdf.append(group, acq_name=name, common_timebase=True)
        mdf.save(path, overwrite=True, compression=2)


def _channels(rows: pd.DataFrame, time: Any, attrs: dict[Any, Any]) -> tuple[list[Any], list[Any]]:
    """The channels that have a value in every row, and those with values in some."""
    from asammdf import Signal

    whole: list[Any] = []
    parts: list[Any] = []
    for name in rows.columns:
        if name in ("time", "timestamp"):  # the times of the channels and the start of the file
            continue
        given = rows[name].notna().to_numpy()
        if not given.any():
            continue
        values, texts = _numbers(rows[name][given])
        channel = Signal(
            samples=values,
            timestamps=time[given],
            name=name,
            unit=attrs.get("units", {}).get(name, ""),
            comment=attrs.get("comments", {}).get(name, ""),
            conversion=texts,
        )
        (whole if given.all() else parts).append(channel)
    return whole, parts


def _numbers(column: pd.Series) -> tuple[Any, dict[str, Any] | None]:
    """Numbers, and the texts that they stand for if any."""
    import pandas as pd

    if column.dtype == bool:
        return column.to_numpy(np.uint8), None
    if pd.api.types.is_numeric_dtype(column):
        return column.to_numpy(), None
    codes, names = pd.factorize(column.astype(str), sort=True)
    texts: dict[str, Any] = {}
    for code, name in enumerate(names):
        texts |= {f"val_{code}": code, f"text_{code}": str(name).encode()}
    return codes.astype(np.uint16), texts


def holds(path: Path) -> bool:
    """Whether an MDF file holds channels and no frames; one that cannot be read has neither."""
    required("asammdf")
    if _older(path):
        return True
    try:
        with _opened(path) as mdf:
            names = [channel.name for group in mdf.groups for channel in group.channels]
    except Exception:  # its frames may be recovered
        return False
    return bool(names) and not any(_BUS_LOGGING.match(name) for name in names)


def _older(path: Path) -> str:
    """The version of a file in MDF 2 or 3; "" of others."""
    with path.open("rb") as file:
        found = _OLDER.match(file.read(16))
    return found[1].decode() if found else ""


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """The file, once its links are known to end."""
    from clutchest.can.log_source import quiet
    from clutchest.can.recovery.half_read import opened
    from clutchest.can.recovery.mf4_channels import OPTIONS
    from clutchest.can.recovery.mf4_links import check_links

    with path.open("rb") as file, quiet("asammdf"), redirect_stdout(StringIO()):
        check_links(path, file)
        with opened(file, **OPTIONS) as mdf:
            yield mdf


def read(path: Path) -> Channels:
    """The channels of a measurement, each with the times of its group."""
    from clutchest.can.recovery.mf4_conversions import unit_of

    if version := _older(path):
        raise ClutchestError(
            f"{path}: MDF {version}, expected MDF 4; asammdf makes it of this one: "
            f"MDF('{path.name}').convert('4.10').save('{path.stem}.mf4')"
        )
    places: dict[str, tuple[int, int]] = {}
    stated: dict[str, str] = {}
    rows = 0
    with _opened(path) as mdf:
        masters = mdf._mdf.masters_db
        for number, group in enumerate(mdf.groups):
            cycles = group.channel_group.cycles_nr
            rows = max(rows, cycles)
            check_cells(path, cycles)
            for index, channel in enumerate(group.channels):
                if not cycles or masters.get(number) == index or channel.name in places:
                    continue
                places[channel.name] = (number, index)
                stated[channel.name] = unit_of(channel)
        start_s = mdf.header.start_time.timestamp()
    if not places:
        raise ClutchestError(f"{path}: no channel with samples")
    absolute = start_s > _EPOCH_S
    start_ns = round(start_s * 1e6) * 1000 if absolute else None

    return Channels(
        str(path), stated, start_ns, rows, lambda name: _channel(path, name, *places[name])
    )


def _channel(path: Path, name: str, number: int, place: int) -> Cells:
    """One channel, by the number of its group and its place within that."""
    from clutchest.can.recovery.mf4_channels import read_channels
    from clutchest.can.recovery.mf4_conversions import physical

    parts = []
    try:
        with _opened(path) as mdf:
            group = mdf.groups[number]
            channel = group.channels[place]
            varies = channel.channel_type in _OF_VARYING_LENGTH
            if varies or channel.data_type > _LAST_NUMBER or group.channel_dependencies[place]:
                raise _NO_NUMBERS
            for part in read_channels(mdf, number, [place]):
                value, given = physical(part.samples[place], channel.conversion)
                if value.ndim != 1 or value.dtype.kind not in "iufb":
                    raise _NO_NUMBERS
                for mask in part.invalid.values():
                    given = given & ~mask
                parts.append((value.astype(np.float64), given, part.times.astype(np.float64)))
    except Exception as problem:  # asammdf has no errors of its own
        words = " ".join(str(problem).split())[:200] or type(problem).__name__
        raise ClutchestError(f"{path}: channel '{name}': {words}") from None
    if not parts:
        raise ClutchestError(f"{path}: channel '{name}': no samples")
    return Cells(*(np.concatenate(column) for column in zip(*parts, strict=True)))


FORMAT = TableKind(
    about="a measurement in MDF 4: channels and no frames, each with the times of its group",
    suffixes=(".mf4", ".mdf"),
    marks=(b"MDF     4", b"MDF     3", b"MDF     2"),
    read=read,
    write=write,
    holds=holds,
    extra="mf4",
)
