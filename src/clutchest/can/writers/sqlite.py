"""python-can's SQLite log: one table, a row per frame."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

from clutchest.can.frames import Flag, Frames

_TABLE = """CREATE TABLE messages (ts REAL, arbitration_id INTEGER, extended INTEGER,
            remote INTEGER, error INTEGER, dlc INTEGER, data BLOB)"""


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
