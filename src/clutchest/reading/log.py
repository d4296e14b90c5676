"""Reading logs: any mixture of CAN logs and decoded tables, as the drives they are."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from clutchest import units
from clutchest.can import files
from clutchest.can.database import Database, Message, load
from clutchest.can.deduplication import without_duplicates
from clutchest.can.frame_filter import FrameFilter
from clutchest.can.frames import Frames
from clutchest.checked import checked
from clutchest.errors import ClutchestError
from clutchest.reading.mapping import NoMappedFrame, signals_of
from clutchest.reading.overlapping import at_the_same_time, given_twice
from clutchest.reading.plausible import plausible
from clutchest.reading.table_drives import drives_of
from clutchest.reading.table_formats import is_table, tables_in_words
from clutchest.reading.table_units import check_bus_units
from clutchest.reading.tables import joined, read_table
from clutchest.reading.wanted import mapped_messages
from clutchest.reading.window import EVERYTHING, TimeWindow
from clutchest.shipped import locate_each, shipped
from clutchest.shown import Showing
from clutchest.signals import Signals
from clutchest.vehicle import Vehicle, load_vehicle

JOIN_S = 60.0  # pieces of one drive lie no further apart
SPLIT_S = 3600.0  # a longer gap without any frame in a log starts a new drive
DataFrame = Any  # of pandas, polars or Arrow
Logs = Path | str | DataFrame | Sequence[Path | str | DataFrame]
_PIECE = 16 << 20  # bytes of payload kept in one piece: each of its columns is a large array


@dataclass(frozen=True, slots=True)
class _Piece:
    """One file: its contents and, on an absolute clock, when it starts and ends (ns); whether any
    of them is ``mapped``."""

    path: Path
    content: Frames | Signals
    absolute: bool
    start: int = 0
    end: int = 0
    warning: str = ""
    mapped: bool = True


def as_signals(given: Signals | Logs, vehicle: Vehicle) -> Signals:
    """Signals, those of a run, and what :func:`read_log` takes as read, in the machine's units; of
    a list with some of these, all drives in its order.

    Raises ClutchestError for another result, whose table is no log, and for a signal in a unit of
    something else.
    """
    if isinstance(given, Signals):
        drives = [_in_units_of(vehicle.machine.units, drive) for drive in given.drives]
        return replace(drives[0], later=tuple(drives[1:]))
    if isinstance(given, Showing):
        own = getattr(given, "signals", None)
        if isinstance(own, Signals):
            return own
        raise ClutchestError(f"expected signals, a log or a run, not a {type(given).__name__}")
    logs = _each(given)
    if not any(isinstance(each, Showing) for each in logs):
        return read_log(logs, vehicle)
    first, *later = (drive for each in logs for drive in as_signals(each, vehicle).drives)
    return replace(first, later=tuple(later))


@partial(checked, own=("window",))
def read_log(
    paths: Logs,
    vehicle: Vehicle | str | Path,
    window: TimeWindow | tuple[float | None, float | None] = EVERYTHING,
    *,
    traffic: bool = True,
    begun: Mapping[Path, Iterator[Frames]] = {},
) -> Signals:
    """The canonical signals of one or several logs; a path may name a shipped log (``demo``).

    CAN logs are decoded with the vehicle's DBC. Of tables (``.csv``, ``.parquet``, ``.xlsx``,
    ``.mat``, ``.tdms``, a measurement in ``.mf4``, a DataFrame of pandas, polars or Arrow) with
    canonical columns, or those of the vehicle file's ``[columns]``, the values within its min … max
    are valid. Logs on absolute clocks that overlap or lie less than a minute apart are pieces of
    one drive; all others are drives of their own, in ``later`` in order of time. Of each drive only
    what lies in ``window``, as ``(60, 300)`` s, is kept, with times in s from its start. Delays
    that the vehicle file states are not applied. Without ``traffic`` the times and the integrity of
    frames, which fault tests need, are left out.  ``begun``: the blocks of logs that are being read
    already, by path.

    Raises ClutchestError for a file that cannot be read, a contradiction between vehicle file and
    DBC, or when no mapped message occurs at all.
    """
    vehicle, window = load_vehicle(vehicle), TimeWindow.of(window)
    logs = _located(_each(paths))
    tabular = [not isinstance(log, Path) or is_table(log) for log in logs]
    framed = [log for log, is_table in zip(logs, tabular, strict=True) if not is_table]
    database, wanted = _decoded_by(vehicle, logs, framed)
    pieces = [
        _table(log, vehicle)
        if is_table
        else _frames(log, begun.get(log) or files.read_blocks(log, tables_in_words()), wanted)
        for log, is_table in zip(logs, tabular, strict=True)
    ]
    groups = [
        _tables_drive(group, vehicle, database, window)
        if isinstance(group[0].content, Signals)
        else _frames_drives(group, vehicle, database, window, traffic)
        for group in _groups(pieces)
    ]
    drives = [drive for group in groups for drive in group.drives]
    unmapped = [problem for group in groups for problem in group.unmapped]
    if not drives and unmapped:
        raise unmapped[0]
    if not drives:
        names = " ".join(str(piece.path) for piece in pieces)
        raise ClutchestError(f"{names}: no data in the time window; {_spans(pieces)}")
    first, *later = drives
    warnings = (
        *given_twice(drives),
        *(warning for group in groups for warning in group.warnings),
        *first.warnings,
        *(f"left out: {problem}" for problem in unmapped),
    )
    return replace(first, later=tuple(later), warnings=warnings)


@dataclass(frozen=True, slots=True)
class _Drives:
    """The drives in a group of pieces, and its parts without any mapped message."""

    drives: tuple[Signals, ...] = ()
    unmapped: tuple[NoMappedFrame, ...] = ()
    warnings: tuple[str, ...] = ()


def _tables_drive(
    group: Sequence[_Piece], vehicle: Vehicle, database: Database, window: TimeWindow
) -> _Drives:
    """The drives in pieces of one table, cut at its long gaps and by the ``window``."""
    tables = [piece.content for piece in group if isinstance(piece.content, Signals)]
    mapped = _only_mapped(joined(tables), vehicle)
    parts = drives_of(mapped, SPLIT_S)
    drives = [window.of_signals(plausible(part, vehicle, database)) for part in parts]
    kept = tuple(drive for drive in drives if drive)
    return _Drives(kept, warnings=tuple(at_the_same_time(group)) if kept else _outside(group))


def _frames_drives(
    group: Sequence[_Piece],
    vehicle: Vehicle,
    database: Database,
    window: TimeWindow,
    traffic: bool,
) -> _Drives:
    """The drives in pieces of one CAN log, cut at its long gaps and by the ``window``."""
    sources = tuple(str(piece.path) for piece in group)
    frames = Frames.concatenate([p.content for p in group if isinstance(p.content, Frames)])
    drives, unmapped = [], []
    for part in _split(without_duplicates(frames.sorted())):
        inside = window.of_frames(part, sources)
        if not len(inside):
            continue
        try:
            drives.append(signals_of(inside, vehicle, database, sources, traffic))
            check_bus_units(drives[-1], vehicle, database)
        except NoMappedFrame as problem:
            unmapped.append(problem)
    warnings = [piece.warning for piece in group if piece.warning]
    if drives:
        warnings += at_the_same_time(group)
        warnings += [
            f"left out: {piece.path}: no frame that {vehicle.path.name} maps"
            for piece in group
            if not piece.mapped
        ]
    elif not unmapped:
        warnings += _outside(group)
    return _Drives(tuple(drives), tuple(unmapped), tuple(warnings))


def _outside(group: Sequence[_Piece]) -> tuple[str, ...]:
    """Warnings of logs of which the time window leaves nothing."""
    span = _spans(group)
    return tuple(f"left out: {piece.path}: no data in the time window; {span}" for piece in group)


def _in_units_of(known: Mapping[str, str], drive: Signals) -> Signals:
    """A drive whose signals are in the ``known`` units, by name.  Raises ClutchestError for one
    that measures something else."""
    other = {n: s for n, s in drive.items() if s.unit not in ("", known.get(n, s.unit))}
    for name, signal in other.items():
        unit = known[name]
        if not units.compatible(signal.unit, unit):
            raise ClutchestError(
                f"signal '{name}' is in {signal.unit}, expected a unit such as {unit}"
            )
        value = units.convert_reading(signal.value, signal.unit, unit)
        other[name] = replace(signal, unit=unit, value=value)
    return replace(drive, signals={**drive.signals, **other}) if other else drive


def _is_frame(given: object) -> bool:
    """Whether it is a DataFrame of pandas, polars or Arrow, or like one."""
    like = hasattr(type(given), "columns") or hasattr(given, "to_pandas")
    return like and not isinstance(given, Showing)


def _each(given: Any) -> list[Any]:
    """What is in a list of logs; one log alone, and so a mapping, bytes or an open file, which are
    no list of them."""
    one = isinstance(given, str | bytes | Path | Mapping) or hasattr(given, "read")
    return [given] if one or _is_frame(given) or not isinstance(given, Iterable) else list(given)


def _located(given: list[Any]) -> list[Any]:
    """The paths of logs among ``given``; DataFrames as they are."""
    if not given:
        raise ClutchestError("no log to read")
    for log in (log for log in given if not isinstance(log, str | Path) and not _is_frame(log)):
        raise ClutchestError(
            f"expected a path or a DataFrame (pandas, polars, Arrow), not {type(log).__name__}"
        )
    paths = iter(locate_each((str(log) for log in given if not _is_frame(log)), "logs"))
    return [log if _is_frame(log) else next(paths) for log in given]


def _spans(pieces: Sequence[_Piece]) -> str:
    """The time that logs cover, in words."""
    first = min(pieces, key=lambda piece: piece.start)
    if not first.absolute:
        return f"it is {(first.end - first.start) / 1e9:.3f} s long"
    start, end = (
        datetime.fromtimestamp(ns / 1e9).astimezone()
        for ns in (first.start, max(piece.end for piece in pieces))
    )
    return f"the log is from {start.isoformat(' ', 'seconds')} to {end.isoformat(' ', 'seconds')}"


def load_database(vehicle: Vehicle, folders: Sequence[Path] = ()) -> Database:
    """The vehicle's DBCs; one that is still missing is searched for in ``folders`` and here.

    Raises ClutchestError naming the file and the folders searched.
    """
    if not vehicle.dbc:
        raise ClutchestError(f"{vehicle.path.name}: no 'dbc', so CAN logs cannot be decoded")
    searched = [*folders, Path.cwd()]
    return load([replace(f, path=_dbc(vehicle, f.path, searched)) for f in vehicle.dbc])


def _decoded_by(
    vehicle: Vehicle, logs: Sequence[Any], framed: Sequence[Path]
) -> tuple[Database, list[Message]]:
    """The database of logs, and the mapped messages where some are ``framed``, of frames."""
    folders = [log.parent for log in logs if isinstance(log, Path)]
    if not framed:
        return _database_if_available(vehicle, folders), []
    if not vehicle.dbc:
        next(files.read_blocks(framed[0], tables_in_words()), None)  # what is no log says so
        raise ClutchestError(
            f"{framed[0]} holds frames, and {vehicle.path.name} has no 'dbc' to decode them by: "
            "expected a table, or a vehicle file that `clutchest inspect` drafts from frames"
        )
    database = load_database(vehicle, folders)
    return database, [database.message(name) for name in mapped_messages(vehicle, database)]


def _database_if_available(vehicle: Vehicle, folders: Sequence[Path]) -> Database:
    """The vehicle's DBCs; an empty database where one is missing or contradicts the vehicle file,
    since tables can be read without."""
    try:
        database = load_database(vehicle, folders)
        mapped_messages(vehicle, database)
    except ClutchestError:
        return Database({})
    return database


def _dbc(vehicle: Vehicle, path: Path, folders: Sequence[Path]) -> Path:
    for candidate in (path, *(folder / path for folder in folders)):
        if candidate.is_file():
            return candidate
    places = ", ".join(dict.fromkeys(str(folder.resolve()) for folder in folders))
    whence = f"; the heading of {vehicle.path} says whose it is" if _is_shipped(vehicle) else ""
    raise ClutchestError(
        f"{vehicle.path.name}: no such DBC: {path}; searched: the vehicle file's folder, the "
        f"shipped DBCs, {places}{whence}"
    )


def _is_shipped(vehicle: Vehicle) -> bool:
    """Whether its file is one of those that travel with the package."""
    return vehicle.path in [path.resolve() for path in shipped("vehicles").values()]


def _table(given: Path | Any, vehicle: Vehicle) -> _Piece:
    signals = read_table(given, vehicle.machine.units, vehicle)
    path = Path(signals.sources[0])
    if signals.start_ns is None:
        return _Piece(path, signals, False, 0, int(signals.end * 1e9))
    end = signals.start_ns + int(signals.end * 1e9)
    return _Piece(path, signals, True, signals.start_ns, end)


def _frames(path: Path, blocks: Iterator[Frames], wanted: Sequence[Message]) -> _Piece:
    """The frames of a log that carry ``wanted`` messages; the log may be larger than memory."""
    needed = FrameFilter(wanted, int(SPLIT_S * 1e9))
    kept = (needed.kept(block) for block in blocks)
    frames = Frames.concatenate(_in_pieces(files.held(path, kept)))
    first, last = int(frames.t_ns.min()), int(frames.t_ns.max())
    back = np.concatenate([np.zeros(1, np.int64), *(s[s < 0] for _, s in frames.steps())])[1:]
    warning = (
        f"{path.name}: the clock goes back {len(back)} time{'s' * (len(back) > 1)}, by "
        f"{-back.min() / 1e9:g} s at most; frames are taken in order of time"
        if len(back)
        else ""
    )
    return _Piece(path, frames, frames.absolute, first, last, warning, needed.found)


def _in_pieces(blocks: Iterable[Frames]) -> Iterator[Frames]:
    """The frames of ``blocks`` in pieces of at least ``_PIECE`` bytes, but for the last one."""
    held, size = list[Frames](), 0
    for block in blocks:
        held.append(block)
        size += block.data.nbytes
        if size >= _PIECE:
            yield Frames.concatenate(held)
            held, size = [], 0
    yield Frames.concatenate(held)


def _groups(pieces: Sequence[_Piece]) -> list[list[_Piece]]:
    """Pieces of one drive together; drives in order of time, of relative clocks as read."""
    groups: list[list[_Piece]] = [[piece] for piece in pieces if not piece.absolute]
    for kind in (Frames, Signals):
        end = None
        clocked = [p for p in pieces if p.absolute and isinstance(p.content, kind)]
        for piece in sorted(clocked, key=lambda p: p.start):
            if end is not None and piece.start - end < JOIN_S * 1e9:
                groups[-1].append(piece)
                end = max(end, piece.end)
            else:
                groups.append([piece])
                end = piece.end
    if all(piece.absolute for piece in pieces):
        return sorted(groups, key=lambda group: group[0].start)
    order = {id(piece): i for i, piece in enumerate(pieces)}
    return sorted(groups, key=lambda group: min(order[id(piece)] for piece in group))


def _split(frames: Frames) -> list[Frames]:
    """The frames (sorted) cut at long gaps: a clock that was set, or a parked vehicle."""
    cuts = [
        first + 1 + int(row)
        for first, step in frames.steps()
        for row in np.flatnonzero(step > SPLIT_S * 1e9)
    ]
    if not cuts:
        return [frames]
    parts = [frames.take(slice(a, b)) for a, b in pairwise([0, *cuts, len(frames)])]
    # What the file as a whole lost is counted once, with the longest part, which is a drive.
    longest = max(parts, key=len)
    return [
        part if part is longest else replace(part, rejected=(), passed_over=(), notes=())
        for part in parts
    ]


def _only_mapped(signals: Signals, vehicle: Vehicle) -> Signals:
    """Without columns for which the vehicle file states no noise, except inputs that have a
    default, and requests, which are only compared."""
    known = {*vehicle.signals, *(i.name for i in vehicle.machine.inputs if i.default is not None)}
    if (tracking := vehicle.machine.tracking) is not None:
        known.add(tracking.request)
    kept = {name: signal for name, signal in signals.items() if name in known}
    if not kept:
        raise ClutchestError(
            f"{' '.join(signals.sources)}: none of its signals "
            f"({', '.join(signals)}) is mapped in "
            f"{vehicle.path.name}"
        )
    dropped = [
        f"signal '{name}' ignored: {vehicle.path.name} does not map it"
        for name in signals
        if name not in kept
    ]
    return replace(signals, signals=kept, warnings=(*signals.warnings, *dropped))
