"""One log of a fleet: its estimates into the dataset, its row into the folder of rows."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from clutchest.errors import ClutchestError
from clutchest.fleet.imprint import Imprint, Passed, rows_of
from clutchest.fleet.logs import FleetLog
from clutchest.paths import named_in_utf8

if TYPE_CHECKING:
    from clutchest.estimate.run import Run
    from clutchest.vehicle import Vehicle

DATASET, ROWS = "fleet.parquet", "logs"
UNKNOWN = "unknown"  # a day
OVERLAPS = (
    "begins before the end of an earlier log: its clock is not relied on, so that temperatures are "
    "not carried over; if both are of one drive, that counts twice"
)


@dataclass(frozen=True, slots=True)
class LogTask:
    """A log to be estimated over, and everything that a worker needs to know: ``key`` under which
    its results are kept, ``out`` the folder of the results."""

    log: FleetLog
    key: str
    vehicle: Vehicle
    out: Path
    rate: float

    @property
    def row(self) -> Path:
        """The file that says that the log is done, and what came out."""
        return self.out / ROWS / f"{self.key}.json"


def estimate_log(task: LogTask, passed: Passed) -> Passed:
    """Estimate over one log from what the vehicle's logs before have ``passed`` on; returns what it
    passes on.

    Estimates first, then the row, each under its name when it is whole, so that nothing is lost
    and nothing counts twice when a worker is killed.  A log that cannot be used, or holds a drive
    that another one holds too, has a row with its ``error``, and the state is passed on.
    """
    from clutchest.estimate.replay import replay
    from clutchest.reading import read_log

    if (done := read_row(task.row)) is not None:
        return passed.after(done)
    try:
        signals = read_log(task.log.path, task.vehicle, traffic=False)
        drives = [Imprint.of(drive, task.log.path) for drive in signals.drives]
        if twin := passed.known(drives):
            return reject(task, f"holds the same drive as {twin}", passed)
        overlaps = passed.ends_after(signals.start_ns)
        state = {**passed.state, "time_ns": None} if passed.state and overlaps else passed.state
        run = replay(signals, task.vehicle, rate=task.rate, state=state)
    except (ClutchestError, OSError) as problem:
        return reject(task, str(problem), passed)
    except Exception as problem:  # that nobody foresaw: it must not stop the others
        return reject(task, f"unexpected error: {type(problem).__name__}: {problem}", passed)
    _write_estimates(run, task)
    row = {
        "error": None,
        "note": OVERLAPS if overlaps else None,
        "drives": drives_of(run),
        "wear": run.summary["wear"],
        "state": run.final,
        "imprints": rows_of(drives),
    }
    return _written(task, row, passed)


def reject(task: LogTask, why: str, passed: Passed) -> Passed:
    """Leave a log out, with the reason; what the logs before it ``passed`` on is, and returned."""
    why = why.removeprefix(f"{task.log.path}: ")  # it stands beside
    return _written(task, {"error": why, "drives": [], "state": passed.state}, passed)


def _written(task: LogTask, found: dict[str, Any], passed: Passed) -> Passed:
    """Keep what came out as the log's row; returns what is passed on."""
    from clutchest.record.files import json_text

    row = {"vehicle": task.log.vehicle, "log": str(task.log.path), "wear": None, **found}
    with _whole(task.row) as unfinished:
        unfinished.write_text(json_text(row), encoding="utf-8")
    kept = read_row(task.row)
    assert kept is not None
    return passed.after(kept)


def drives_of(run: Run) -> list[dict[str, Any]]:
    """Of every drive when it was, how much slip there was, and the states at its end."""
    rows = []
    for signals, track in zip(run.signals.drives, run.tracks, strict=True):
        states = {
            name: {
                "value": float(e.value[-1]),
                "std": float(e.std[-1]),
                "valid": bool(e.valid[-1]),
            }
            for name, e in track.states.items()
            if len(track.time)
        }
        found = track.contradiction
        rows.append(
            {
                "begin": _utc(signals.start_ns),
                "day": day_of(signals.start_ns),
                "duration_s": float(track.time[-1]) if len(track.time) else 0.0,
                "slip_events": len(track.engagements),
                "slip_energy_J": float(sum(event.energy_J for event in track.engagements)),
                "contradiction": "; ".join(filter(None, (found.words, found.explanation)))
                if found
                else None,
                "states": states,
            }
        )
    return rows


def begin_of(path: Path, vehicle: Vehicle) -> int | None:
    """Epoch time in ns of a log's first frame or row; None where it is not known."""
    from clutchest.can.files import read_blocks
    from clutchest.reading.table_formats import is_table
    from clutchest.reading.tables import read_table

    try:
        if is_table(path):
            return read_table(path, vehicle.machine.units, vehicle).start_ns
        blocks = read_blocks(path)
        first = next(frames for frames in blocks if len(frames))
        return int(first.t_ns.min()) if first.absolute else None
    except Exception:  # said when the log is used
        return None


def day_of(start_ns: int | None) -> str:
    """The day on which a drive began, UTC."""
    return (_utc(start_ns) or UNKNOWN)[:10]


def _utc(start_ns: int | None) -> str | None:
    if start_ns is None:
        return None
    return datetime.fromtimestamp(start_ns / 1e9, UTC).isoformat(timespec="milliseconds")


def _write_estimates(run: Run, task: LogTask) -> None:
    """The rows of every drive into the folder of its vehicle and day."""
    from clutchest.record.arrow import without_pandas
    from clutchest.record.files import write_estimates

    for drive, signals in enumerate(run.signals.drives):
        vehicle, day = f"vehicle={task.log.vehicle}", f"day={day_of(signals.start_ns)}"
        place = task.out / DATASET / vehicle / day / f"{task.key}-{drive}.parquet"
        with (
            _whole(place) as unfinished,
            named_in_utf8(unfinished.parent) as folder,
            without_pandas(),
        ):
            write_estimates(run, folder / unfinished.name, drive)


@contextmanager
def _whole(path: Path) -> Iterator[Path]:
    """A path to write to, which takes its name once all is written."""
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_name(f".{os.getpid()}-{path.name}")
    try:
        yield unfinished
        unfinished.replace(path)
    finally:
        unfinished.unlink(missing_ok=True)


def read_row(path: Path) -> dict[str, Any] | None:
    """A row; None where there is none, or what is there is damaged."""
    try:
        row = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return row if isinstance(row, dict) and {"drives", "state"} <= set(row) else None
