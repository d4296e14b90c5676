"""python-can's SQLite log: one table, a row per frame."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing, suppress
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from clutchest.budgets import SQLITE_STEPS, SQLITE_VALUE_BYTES, UNPACKED_BYTES
from clutchest.can.frames import Flag, Frames
from clutchest.can.log_format import NO_CHANNELS, NO_DIRECTION, LogFormat, Loss, begins_with
from clutchest.can.log_source import LogSource, opened, quiet
from clutchest.can.python_can_messages import BLOCK, BROKEN, MessageColumns, blocks_of
from clutchest.can.time_stamps import counts_from_epoch
from clutchest.errors import ClutchestError

_MARK = b"SQLite format 3"
_STEPS = 100_000  # between two looks at what is left
_TABLE = """CREATE TABLE messages (ts REAL, arbitration_id INTEGER, extended INTEGER,
            remote INTEGER, error INTEGER, dlc INTEGER, data BLOB)"""


def read(source: LogSource) -> Iterator[Frames]:
    """The frames; of a damaged file those in the pages that are whole."""
    if source.zipped:
        with TemporaryDirectory(prefix="clutchest-") as folder:
            plain = Path(folder) / source.path.stem
            plain.write_bytes(source.everything(UNPACKED_BYTES))
            with opened(plain) as unpacked:
                yield from read(unpacked)
        return
    absolute, count = None, 0
    for frames in _blocks(source):
        count += len(frames)
        if absolute is None and len(frames):
            absolute = counts_from_epoch(frames.t_ns)
        yield replace(frames, absolute=absolute is not False)
        if any(why == BROKEN for why, _ in frames.rejected):
            for more in _behind(source, count):
                yield replace(more, absolute=absolute is not False)


def _blocks(source: LogSource) -> Iterator[Frames]:
    """What python-can reads, up to the first damaged page."""
    from can import SqliteReader

    with quiet("can"):
        try:
            reader = SqliteReader(source.path)
        except Exception as error:
            if not source.head.startswith(_MARK):
                raise ClutchestError(
                    f"{source.path}: the file is damaged ({type(error).__name__}: {error})"
                ) from None
            yield Frames.empty(rejected=((BROKEN, 1),))
            return
        with reader:
            _bounded(source, reader._conn)
            yield from blocks_of(reader)


def _bounded(source: LogSource, database: sqlite3.Connection) -> None:
    """Lets the file ask for values and work in proportion to its size only.

    Raises ClutchestError where 'messages' is not a table: a view may make rows without end.
    """
    database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, SQLITE_VALUE_BYTES)
    steps, per_byte = SQLITE_STEPS
    left = iter(range((steps + per_byte * source.path.stat().st_size) // _STEPS))
    database.set_progress_handler(lambda: next(left, None) is None, _STEPS)
    try:
        found = database.execute(
            "SELECT type, sql FROM sqlite_master WHERE name = 'messages'"
        ).fetchall()
    except (sqlite3.Error, UnicodeDecodeError):
        return  # a damaged file, which the reader says
    for kind, text in found:
        if kind != "table" or "GENERATED" in text.upper() or "VIRTUAL" in text.upper():
            raise ClutchestError(
                f"{source.path}: 'messages' is a {kind} that makes its rows "
                "itself, expected a plain table"
            )


def _behind(source: LogSource, count: int) -> Iterator[Frames]:
    """The frames behind the first ``count``, from the pages that are whole."""
    from can import Message
    from clutchest.can.recovery import sqlite as pages

    columns = MessageColumns()
    for rowid, values in pages.rows(source):
        if rowid <= count or len(values) != 7 or not isinstance(values[6], bytes):
            continue
        stamp, identifier, extended, remote, error, dlc, data = values
        with suppress(TypeError, ValueError):  # not a frame
            columns.add(
                Message(
                    timestamp=float(stamp),
                    arbitration_id=identifier,
                    is_extended_id=bool(extended),
                    is_remote_frame=bool(remote),
                    is_error_frame=bool(error),
                    dlc=dlc,
                    data=data,
                    is_fd=len(data) > 8,
                    check=True,
                )
            )
        if len(columns.rows) == BLOCK:
            yield replace(columns.frames(), rejected=())
            columns = MessageColumns()
    yield replace(columns.frames(), rejected=())


def write(frames: Frames, path: Path) -> None:
    """Write over whatever is there."""
    path.unlink(missing_ok=True)
    flags = [
        ((frames.flags & flag) != 0).tolist() for flag in (Flag.EXTENDED, Flag.REMOTE, Flag.ERROR)
    ]
    length = frames.length.tolist()
    carried = [0 if remote else n for remote, n in zip(flags[1], length, strict=True)]
    payloads = [row[:n].tobytes() for row, n in zip(frames.data, carried, strict=True)]
    rows = zip(
        (frames.t_ns / 1e9).tolist(), frames.id.tolist(), *flags, length, payloads, strict=True
    )
    with closing(sqlite3.connect(path)) as database, database:
        database.execute(_TABLE)
        database.executemany("INSERT INTO messages VALUES (?, ?, ?, ?, ?, ?, ?)", rows)


def _short_fd(frames: Frames) -> int:
    return int(np.count_nonzero((frames.length <= 8) & ((frames.flags & Flag.FD) != 0)))


FORMAT = LogFormat(
    title=".db of python-can",
    about="python-can's, SQLite",
    suffix=".db",
    sniff=begins_with(_MARK),
    by_suffix=lambda suffix: suffix == ".db",
    read=read,
    save=write,
    losses=(
        NO_CHANNELS,
        NO_DIRECTION,
        Loss(
            "times finer than 1 µs",
            "holds times to 1 µs",
            lambda frames: int(np.count_nonzero(frames.t_ns % 1000)),
        ),
        Loss(
            "CAN FD with 8 bytes or less",
            "cannot tell FD frames of 8 bytes or less from others",
            _short_fd,
        ),
    ),
)
