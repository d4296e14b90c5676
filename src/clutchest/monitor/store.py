"""The files of a live session: whatever happens to the process, nothing that was reported is lost.

A format that cannot be appended to is first written in one that can, and converted at the end, or
by the next session in the same folder.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import IO, Any

import numpy as np

from clutchest.can.formats import candump
from clutchest.can.frames import Frames
from clutchest.errors import ClutchestError
from clutchest.estimate.run import Track, columns_of
from clutchest.record.files import json_text, plain

RECEIVED, EVENTS, ESTIMATES = "received.log", "events.jsonl", "estimates.parquet"
RECORDING, STATE = "recording.rrd", "state.json"
GROWING = "estimates.growing"  # rows so far, after one line with their layout
RUNNING = "session.json"  # exists while a session runs
_ROWS = 100_000  # rows of one group of the Parquet file


class Session:
    """The files of one session in ``out``, created if need be.

    Files of an earlier session are moved into a folder of their own; ``notes`` says which.
    Raises ClutchestError where ``out`` is no folder, or another session runs in it.
    """

    def __init__(self, out: Path, provenance: Mapping[str, str]) -> None:
        if out.exists() and not out.is_dir():
            raise ClutchestError(f"{out}: is a file, expected a folder for the results")
        out.mkdir(parents=True, exist_ok=True)
        self.out, self.provenance = out, dict(provenance)
        self._lock = _locked(out)
        self.notes = _moved_aside(out)
        self._received: IO[bytes] = (out / RECEIVED).open("wb", buffering=0)
        self._events: IO[bytes] = (out / EVENTS).open("wb", buffering=0)
        self._rows: IO[bytes] | None = None
        self._modes: list[str] = []

    @property
    def recording(self) -> Path:
        """The path of the recording."""
        return self.out / RECORDING

    def receive(self, frames: Frames) -> None:
        """Write frames with the stamps that are used, before they are processed."""
        if len(frames):
            self._received.write(b"".join(candump.write(frames)))

    def event(self, event: Mapping[str, Any]) -> None:
        """Write an event."""
        self._events.write(_line(event))

    def keep(self, track: Track, drive: int, start_ns: int | None, restarted: bool) -> None:
        """Write the rows of a track whose time begins at ``start_ns``; where ``restarted`` they
        replace those of the same drive."""
        columns = columns_of(track, drive, start_ns)
        mode = np.asarray(track.mode, np.uint8)
        table = np.empty(len(track.time), _layout(columns))
        for name in columns:
            table[name] = mode if name == "mode" else columns[name]
        if self._rows is None or (restarted and drive == 0):
            self._begin(table.dtype, track.mode_names)
        elif restarted:
            self._drop(table.dtype, drive)
        assert self._rows is not None
        self._rows.write(table.tobytes())

    def close(self, state: Mapping[str, Any] | None = None) -> list[str]:
        """Give every file its final form; returns their names."""
        self._received.close()
        self._events.close()
        if self._rows is not None:
            self._rows.close()
        if state is not None:
            (self.out / STATE).write_text(json_text(state), encoding="utf-8")
        finish(self.out)
        (self.out / RUNNING).unlink(missing_ok=True)
        self._lock.close()
        names = (RECEIVED, EVENTS, ESTIMATES, RECORDING, STATE)
        return [name for name in names if (self.out / name).exists()]

    def _begin(self, layout: np.dtype, modes: tuple[str, ...]) -> None:
        if self._rows is not None:
            self._rows.close()
        self._rows = (self.out / GROWING).open("wb+", buffering=0)
        head = {"columns": layout.descr, "modes": modes, "provenance": self.provenance}
        self._rows.write(json.dumps(head).encode() + b"\n")

    def _drop(self, layout: np.dtype, drive: int) -> None:
        """Remove the rows of the last drive."""
        assert self._rows is not None
        head, rows = read_growing(self.out / GROWING)
        keep = int(np.searchsorted(rows["drive"], drive))
        del rows
        self._rows.seek(head + keep * layout.itemsize)
        self._rows.truncate()


def _layout(columns: Mapping[str, Any]) -> np.dtype:
    kinds = {"mode": np.uint8, "drive": np.int32}
    return np.dtype(
        [(name, kinds.get(name, np.asarray(column).dtype)) for name, column in columns.items()]
    )


def _line(value: Mapping[str, Any]) -> bytes:
    return json.dumps(plain(value), ensure_ascii=False).encode() + b"\n"


def read_growing(path: Path) -> tuple[int, np.ndarray]:
    """Offset of the first row in a growing table, and its complete rows (memory-mapped)."""
    with path.open("rb") as file:
        head = file.readline()
    layout = np.dtype([(name, kind) for name, kind in json.loads(head)["columns"]])
    count = (path.stat().st_size - len(head)) // layout.itemsize
    if not count:
        return len(head), np.zeros(0, layout)
    return len(head), np.memmap(path, layout, "r", len(head), (count,))


def finish(out: Path) -> list[str]:
    """Complete the files of a session, however it ended; returns those that were, in words."""
    done = []
    if (out / GROWING).exists():
        _, rows = read_growing(out / GROWING)
        _to_parquet(out, rows)
        done.append(f"{ESTIMATES} ({len(rows)} rows)")
        del rows
        (out / GROWING).unlink()
    recording = out / RECORDING
    if recording.exists() and recording.stat().st_size and _complete(recording):
        done.append(RECORDING)
    return done


def _to_parquet(out: Path, rows: np.ndarray) -> None:
    import pandas as pd
    import pyarrow as pa
    import pyarrow.parquet as pq

    with (out / GROWING).open("rb") as file:
        head = json.loads(file.readline())
    writer = None
    unfinished = out / f".{ESTIMATES}"
    for first in range(0, max(len(rows), 1), _ROWS):
        part = rows[first : first + _ROWS]
        columns = {name: np.array(part[name]) for name in part.dtype.names or ()}
        columns["mode"] = pd.Categorical.from_codes(columns["mode"], head["modes"])
        columns["log"] = pd.Categorical.from_codes(columns["log"], [RECEIVED])
        columns["timestamp"] = pd.DatetimeIndex(columns["timestamp"]).tz_localize("UTC")
        table = pa.Table.from_pandas(pd.DataFrame(columns), preserve_index=False)
        if writer is None:
            origin = {k.encode(): v.encode() for k, v in head["provenance"].items()}
            schema = table.schema.with_metadata({**(table.schema.metadata or {}), **origin})
            writer = pq.ParquetWriter(unfinished, schema)
        writer.write_table(table.cast(schema))
    assert writer is not None
    writer.close()
    unfinished.replace(out / ESTIMATES)


def _complete(recording: Path) -> bool:
    """Rewrite a recording with all that can be read of it and a proper end."""
    whole = recording.with_name(f".{recording.name}")
    command = [
        sys.executable,
        "-m",
        "rerun",
        "rrd",
        "optimize",
        "--continue-on-error",
        str(recording),
        "-o",
        str(whole),
    ]
    try:
        result = subprocess.run(command, capture_output=True, check=False, start_new_session=True)
    except OSError:
        return False
    if result.returncode or not whole.exists() or not whole.stat().st_size:
        whole.unlink(missing_ok=True)
        return False
    whole.replace(recording)
    return True


def _locked(out: Path) -> IO[str]:
    """The file that marks a running session, locked for as long as it runs."""
    file = (out / RUNNING).open("a+", encoding="utf-8")
    try:
        import fcntl
    except ImportError:  # this platform has no such locks
        return file
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        file.close()
        raise ClutchestError(
            f"{out}: another session writes into this folder; expected a folder "
            "of its own for each (--out)"
        ) from None
    return file


def _moved_aside(out: Path) -> list[str]:
    """Move an earlier session's files into a folder named by when it ended; notes for the user."""
    running = out / RUNNING
    killed = bool(running.read_text(encoding="utf-8").strip())
    begun = datetime.now(UTC).isoformat(timespec="seconds")
    notes = []
    if (out / RECEIVED).exists():
        when = datetime.fromtimestamp((out / RECEIVED).stat().st_mtime, UTC)
        aside = out / when.strftime("until-%Y-%m-%dT%H-%M-%SZ")
        aside.mkdir(exist_ok=True)
        for name in (RECEIVED, EVENTS, ESTIMATES, RECORDING, STATE, GROWING):
            if (out / name).exists():
                (out / name).replace(aside / name)
        if killed:
            done = finish(aside)
            notes.append(f"the last session was cut off: {', '.join(done) or 'nothing'} repaired")
        notes.append(f"the last session's files are now in {aside}")
    running.write_text(json.dumps({"pid": os.getpid(), "begun": begun}) + "\n", encoding="utf-8")
    return notes
