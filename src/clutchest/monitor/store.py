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
from clutchest.monitor.growing import (
    GrowingFile,
    cut_last_line,
    head_line,
    layout_of,
    read_growing,
)
from clutchest.paths import named_in_utf8
from clutchest.record.files import finished_into, json_text, sweep

RECEIVED, EVENTS, ESTIMATES = "received.log", "events.jsonl", "estimates.parquet"
RECORDING, STATE = "recording.rrd", "state.json"
GROWING = "estimates.growing"  # rows so far, after one line with their layout
RUNNING = "session.json"  # exists while a session runs
_ROWS = 100_000  # rows of one group of the Parquet file


class Session:
    """The files of one session in ``out``, created if need be.

    Files of an earlier session are moved into a folder of their own; ``notes`` says which.
    Raises ClutchestError where ``out`` is no folder, another session runs in it, or the disk
    refuses.
    """

    def __init__(self, out: Path, provenance: Mapping[str, str]) -> None:
        if out.exists() and not out.is_dir():
            raise ClutchestError(f"{out}: is a file, expected a folder for the results")
        out.mkdir(parents=True, exist_ok=True)
        self.out, self.provenance = out, dict(provenance)
        self._lock = _locked(out)
        self.notes = _moved_aside(out)
        self._received, self._events = GrowingFile(out / RECEIVED), GrowingFile(out / EVENTS)
        self._rows: GrowingFile | None = None

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
        self._events.write(json_text(event, indent=None).encode())

    def keep(self, track: Track, drive: int, start_ns: int | None, restarted: bool) -> None:
        """Write the rows of a track whose time begins at ``start_ns``; where ``restarted`` they
        replace those of the same drive."""
        columns = columns_of(track, drive, start_ns)
        mode = np.asarray(track.mode, np.uint8)
        table = np.empty(len(track.time), layout_of(columns))
        for name in columns:
            table[name] = mode if name == "mode" else columns[name]
        if self._rows is None or (restarted and drive == 0):
            if self._rows is not None:
                self._rows.close()
            self._rows = GrowingFile(self.out / GROWING)
            about = {"modes": track.mode_names, "provenance": self.provenance}
            self._rows.write(head_line(table.dtype, about))
        elif restarted:
            _, head, rows = read_growing(self.out / GROWING)
            keep = int(np.searchsorted(rows["drive"], drive))
            del rows
            self._rows.cut(head + keep * table.dtype.itemsize)
        self._rows.write(table.tobytes())

    def close(self, state: Mapping[str, Any] | None = None) -> list[str]:
        """Give every file its final form; returns their names.

        Raises ClutchestError or OSError where the disk refuses; then the next session does it.
        """
        for file in (self._received, self._events, self._rows):
            if file is not None:
                file.close()
        try:
            finish(self.out, state)
            (self.out / RUNNING).unlink(missing_ok=True)
        finally:
            self._lock.close()
        names = (RECEIVED, EVENTS, ESTIMATES, RECORDING, STATE)
        return [name for name in names if (self.out / name).exists()]


def finish(out: Path, state: Mapping[str, Any] | None = None) -> list[str]:
    """Complete the files of a session, however it ended; returns those that were, in words."""
    done = []
    for name in (RECEIVED, EVENTS):
        cut_last_line(out / name)
    with finished_into(out) as folder:
        if state is not None:
            (folder / STATE).write_text(json_text(state), encoding="utf-8")
        if (out / GROWING).exists():
            head, _, rows = read_growing(out / GROWING)
            if head:
                _to_parquet(folder / ESTIMATES, head, rows)
                done.append(f"{ESTIMATES} ({len(rows)} rows)")
            del rows
        recording = out / RECORDING
        whole = recording.exists() and recording.stat().st_size > 0
        if whole and _complete(recording, folder / RECORDING):
            done.append(RECORDING)
    (out / GROWING).unlink(missing_ok=True)
    return done


def _to_parquet(path: Path, head: Mapping[str, Any], rows: np.ndarray) -> None:
    import pandas as pd
    import pyarrow as pa
    import pyarrow.parquet as pq

    writer = None
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
            writer = pq.ParquetWriter(path, schema)
        writer.write_table(table.cast(schema))
    assert writer is not None
    writer.close()


def _complete(recording: Path, whole: Path) -> bool:
    """Write ``whole``: all that can be read of a recording, and a proper end."""
    command = [sys.executable, "-m", "rerun_cli", "rrd", "optimize", "--continue-on-error"]
    try:
        with named_in_utf8(recording) as file:
            result = subprocess.run(
                [*command, str(file), "-o", str(whole)],
                capture_output=True,
                check=False,
                start_new_session=True,
            )
    except OSError:
        return False
    if result.returncode or not whole.exists() or not whole.stat().st_size:
        whole.unlink(missing_ok=True)
        return False
    return True


def _locked(out: Path) -> IO[str]:
    """The file that marks a running session, locked for as long as it runs."""
    file = (out / RUNNING).open("a+", encoding="utf-8")
    try:
        import fcntl
    except ImportError:  # this platform has no such locks, and removes no file that is open
        file.close()
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
    """Complete an earlier session's files where it was cut off, and move them into a folder named
    by when it ended; notes for the user.  Whenever this is cut off, the next one goes on with it.
    """
    running = out / RUNNING
    killed = bool(running.read_text(encoding="utf-8").strip())
    begun = datetime.now(UTC).isoformat(timespec="seconds")
    notes = []
    sweep(out)
    if (out / RECEIVED).exists():
        when = datetime.fromtimestamp((out / RECEIVED).stat().st_mtime, UTC)
        if killed:
            done = finish(out)
            notes.append(f"the last session was cut off: {', '.join(done) or 'nothing'} repaired")
        aside = _free(out / when.strftime("until-%Y-%m-%dT%H-%M-%SZ"))
        aside.mkdir(exist_ok=True)
        for name in (EVENTS, ESTIMATES, RECORDING, STATE, RECEIVED):  # that one says when, so last
            if (out / name).exists():
                (out / name).replace(aside / name)
        notes.append(f"the last session's files are now in {aside}")
    running.write_text(json.dumps({"pid": os.getpid(), "begun": begun}) + "\n", encoding="utf-8")
    return notes


def _free(folder: Path) -> Path:
    """This folder, or one like it, without a session's files."""
    number, free = 1, folder
    while (free / RECEIVED).exists():
        number += 1
        free = folder.with_name(f"{folder.name}-{number}")
    return free
