"""Reading logs: any mixture of CAN logs and decoded tables, as the drives they are."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from itertools import pairwise
from pathlib import Path

import numpy as np

from clutchest.can import files
from clutchest.can.database import Database, Message, load
from clutchest.can.deduplication import without_duplicates
from clutchest.can.frame_filter import FrameFilter
from clutchest.can.frames import Frames
from clutchest.errors import ClutchestError
from clutchest.reading.mapping import NoMappedFrame, signals_of
from clutchest.reading.plausible import plausible
from clutchest.reading.tables import is_table, joined, read_table
from clutchest.reading.wanted import mapped_messages
from clutchest.reading.window import EVERYTHING, Window
from clutchest.shipped import locate
from clutchest.signals import Signals
from clutchest.vehicle import Vehicle, load_vehicle

JOIN_S = 60.0  # pieces of one drive lie no further apart
_PIECE = 1 << 18  # frames that are put away together: each column of them is a large array
HOLE_S = 3600.0  # a longer silence inside a log starts a new drive


@dataclass(frozen=True, slots=True)
class _Piece:
    """One file: its contents and, on an absolute clock, when it starts and ends (ns)."""

    path: Path
    content: Frames | Signals
    absolute: bool
    start: int = 0
    end: int = 0
    warning: str = ""


def read_log(
    paths: Path | str | Sequence[Path | str],
    vehicle: Vehicle | str | Path,
    window: Window = EVERYTHING,
    *,
    traffic: bool = True,
) -> Signals:
    """The canonical signals of one or several logs; a path may name a shipped log (``demo``).

    CAN logs are decoded through the vehicle's DBC, ``.csv`` and ``.parquet`` with canonical columns
    are taken as they are within the file's min … max.  Logs on absolute clocks that overlap or lie
    less than a minute apart are pieces of one drive; all others are drives of their own, on
    ``later`` in order of time.
    Of each drive only what lies in ``window`` is kept.  Times are s from the start of what is kept.
    Delays that the vehicle file states are not applied.  Without ``traffic`` nothing is kept of
    when frames came and whether they were whole, which fault tests need.

    Raises ClutchestError for a file that cannot be read, a contradiction between vehicle file and
    DBC, or when no mapped message occurs at all.
    """
    vehicle = load_vehicle(vehicle)
    found = _located([paths] if isinstance(paths, str | Path) else list(paths))
    tabular = [is_table(path) for path in found]
    folders = [path.parent for path in found]
    if all(tabular):
        database, wanted = _if_there(vehicle, folders), []
    else:
        database = load_database(vehicle, folders)
        wanted = [database.message(name) for name in mapped_messages(vehicle, database)]
    columns = vehicle.machine.units
    pieces = [
        _table(path, columns) if is_table else _frames(path, wanted)
        for path, is_table in zip(found, tabular, strict=True)
    ]
    drives: list[Signals] = []
    empty: list[NoMappedFrame] = []
    warnings: list[str] = []
    for group in _groups(pieces):
        tables = [piece.content for piece in group if isinstance(piece.content, Signals)]
        if tables:
            mapped = _only_mapped(joined(tables), vehicle)
            cut = window.of_signals(plausible(mapped, vehicle, database))
            drives += [cut] if cut else []
            continue
        sources = tuple(str(piece.path) for piece in group)
        frames = Frames.concatenate([p.content for p in group if isinstance(p.content, Frames)])
        frames = without_duplicates(frames.sorted())
        warnings += [piece.warning for piece in group if piece.warning]
        for part in _split(frames):
            inside = window.of_frames(part, sources)
            if not len(inside):
                continue
            try:
                drives.append(signals_of(inside, vehicle, database, sources, traffic))
            except NoMappedFrame as problem:
                empty.append(problem)
    if not drives and empty:
        raise empty[0]
    if not drives:
        raise ClutchestError(
            f"{' '.join(map(str, found))}: no data in the time window; " + _spans(pieces)
        )
    first, *later = drives
    told = (*warnings, *first.warnings, *(str(problem) for problem in empty))
    return replace(first, later=tuple(later), warnings=told)


def _located(given: list[Path | str]) -> list[Path]:
    if not given:
        raise ClutchestError("no log to read")
    found = [locate(str(path), "logs") for path in given]
    once = dict.fromkeys(path.resolve() for path in found)
    if len(once) < len(found):
        twice = next(
            p
            for i, p in enumerate(found)
            if p.resolve() in {other.resolve() for other in found[:i]}
        )
        raise ClutchestError(f"{twice}: given twice; each log counts once")
    return found


def _spans(pieces: Sequence[_Piece]) -> str:
    """From when to when logs go, in words."""
    first = min(pieces, key=lambda piece: piece.start)
    if not first.absolute:
        return f"it is {(first.end - first.start) / 1e9:.3f} s long"
    start, end = (
        datetime.fromtimestamp(ns / 1e9).astimezone()
        for ns in (first.start, max(piece.end for piece in pieces))
    )
    return f"the log goes from {start.isoformat(' ', 'seconds')} to {end.isoformat(' ', 'seconds')}"


def load_database(vehicle: Vehicle, folders: Sequence[Path] = ()) -> Database:
    """The vehicle's DBCs; one that is still missing is looked for in ``folders`` and here.

    Raises ClutchestError naming the file and where it was looked for.
    """
    if not vehicle.dbc:
        raise ClutchestError(f"{vehicle.path.name}: no 'dbc', so CAN logs cannot be decoded")
    return load([_dbc(vehicle, path, [*folders, Path.cwd()]) for path in vehicle.dbc])


def _if_there(vehicle: Vehicle, folders: Sequence[Path]) -> Database:
    """The vehicle's DBCs where they are at hand and fit it; tables do without them."""
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
    raise ClutchestError(
        f"{vehicle.path.name}: no such DBC: {path}; looked beside the vehicle "
        f"file, among the shipped ones and in {places}"
    )


def _table(path: Path, columns: dict[str, str]) -> _Piece:
    signals = read_table(path, columns)
    if signals.start_ns is None:
        return _Piece(path, signals, False, 0, int(signals.end * 1e9))
    return _Piece(path, signals, True, signals.start_ns, signals.start_ns + int(signals.end * 1e9))


def _frames(path: Path, wanted: Sequence[Message]) -> _Piece:
    """What is wanted of a log, which itself may be larger than memory."""
    needed = FrameFilter(wanted, int(HOLE_S * 1e9))
    kept = _in_pieces(needed.kept(block) for block in files.read_blocks(path))
    frames = Frames.concatenate(kept)
    first, last = int(frames.t_ns.min()), int(frames.t_ns.max())
    back = np.concatenate([np.zeros(1, np.int64), *(s[s < 0] for _, s in frames.steps())])[1:]
    warning = (
        f"{path.name}: the clock goes back {len(back)} time{'s' * (len(back) > 1)}, by "
        f"{-back.min() / 1e9:g} s at most; frames are taken in order of time"
        if len(back)
        else ""
    )
    return _Piece(path, frames, frames.absolute, first, last, warning)


def _in_pieces(blocks: Iterable[Frames]) -> Iterator[Frames]:
    """The frames of many blocks together, as many as make a large array."""
    held: list[Frames] = []
    for block in blocks:
        held.append(block)
        if sum(map(len, held)) >= _PIECE:
            yield Frames.concatenate(held)
            held = []
    yield Frames.concatenate(held)


def _groups(pieces: Sequence[_Piece]) -> list[list[_Piece]]:
    """Pieces of one drive together; drives in order of time, as read where no clock tells it."""
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
    """The frames (sorted) cut at long silences: a clock that was set, or a parked vehicle."""
    cuts = [
        first + 1 + int(row)
        for first, step in frames.steps()
        for row in np.flatnonzero(step > HOLE_S * 1e9)
    ]
    if not cuts:
        return [frames]
    parts = [frames.take(slice(a, b)) for a, b in pairwise([0, *cuts, len(frames)])]
    # What the file as a whole lost is told once, with the longest part: that one is a drive.
    longest = max(parts, key=len)
    return [
        part if part is longest else replace(part, rejected=(), passed_over=()) for part in parts
    ]


def _only_mapped(signals: Signals, vehicle: Vehicle) -> Signals:
    """Without columns for which the vehicle file declares no noise: nothing could be made of
    them, except inputs that have a default anyway."""
    inputs = {i.name for i in vehicle.machine.inputs if i.default is not None}
    kept = {
        name: signal
        for name, signal in signals.items()
        if name in vehicle.signals or name in inputs
    }
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
