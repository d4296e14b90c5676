"""The files of a run: estimates, summary, recording, state.  All of them or none is replaced."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from shutil import rmtree
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clutchest import memory_mapped
from clutchest.budgets import STATE_BYTES, within
from clutchest.checked import checked
from clutchest.errors import ClutchestError
from clutchest.estimate.run import Run, columns_of, log_of
from clutchest.extras import installed
from clutchest.paths import as_written, named_in_utf8, readable
from clutchest.reading.table_formats import write_table
from clutchest.shown import plain

INNOVATIONS, REPORT = "innovations.parquet", "report.html"
_UNFINISHED = ".unfinished-"  # and the process that writes it
_FINISHED = ".finished-"  # likewise: every file is complete, and is moving into its place
_PASSAGE = re.compile(r"[/\\](\.unfinished-|\.finished-)[^/\\]*")
_PORTION = 25_000  # rows of a table that are written together


def json_text(value: Any, ascii_only: bool = False, indent: int | None = 2) -> str:
    """``value`` as strict JSON: numbers that are missing or not finite become null."""
    text = json.dumps(plain(value), indent=indent, ensure_ascii=ascii_only, allow_nan=False)
    return readable(text) + "\n"


@checked
def write_run(
    run: Run,
    out: str | Path,
    innovations: bool = False,
    formats: Sequence[str] = (),
    report: bool = False,
) -> list[Path]:
    """Write ``estimates.parquet``, ``summary.json``, ``recording.rrd`` (where rerun is installed)
    and ``state.json``; with ``report`` also ``report.html``.

    With ``innovations`` also ``innovations.parquet`` (time, drive, sensor, innovation, std), with
    ``formats`` (``csv``, ``xlsx``, ``mf4``, ``mcap``) the estimates in these files too.  All
    are finished beside their place first, so a write that fails leaves the earlier files whole.
    Gives the paths written.  Raises ClutchestError if ``out`` is no folder, OSError if the disk
    refuses.
    """
    from clutchest.record.arrow import without_pandas

    out = as_written(out)
    with finished_into(out) as folder:
        with without_pandas(), ThreadPoolExecutor(1) as thread:
            recording = thread.submit(_write_recording, run, folder / "recording.rrd")
            write_estimates(run, folder / "estimates.parquet")
            (folder / "summary.json").write_text(json_text(run.summary), encoding="utf-8")
            (folder / "state.json").write_text(json_text(run.final), encoding="utf-8")
            if innovations:
                _write_tables(_innovations(run), folder / INNOVATIONS, run.provenance)
            recording.result()
        if report:
            from clutchest.record.html_reports import run_page

            (folder / REPORT).write_text(readable(run_page(run)), encoding="utf-8")
        for suffix in formats:
            write_table(run.to_pandas(), folder / f"estimates.{suffix}")
        names = sorted(path.name for path in folder.iterdir())
    if not innovations:
        # Those of an earlier run would not belong to the estimates beside them.
        (out / INNOVATIONS).unlink(missing_ok=True)
    if not report:
        (out / REPORT).unlink(missing_ok=True)
    return [out / name for name in names]


def _write_recording(run: Run, path: Path) -> None:
    """As :func:`clutchest.record.rerun.write_recording`, where rerun is installed."""
    if installed("rerun"):
        from clutchest.record.rerun import write_recording

        write_recording(run, path)


@contextmanager
def finished_into(out: Path) -> Iterator[Path]:
    """A folder to write files in; they move into ``out``, made if need be, once all are done.

    Whatever fails on the way leaves ``out`` as it was; a process that is killed while they move
    leaves the rest to the next one here.  Raises ClutchestError if ``out`` is no folder, OSError
    if the disk refuses.
    """
    if out.exists() and not out.is_dir():
        raise ClutchestError(f"{out}: is a file, expected a folder for the results")
    out.mkdir(parents=True, exist_ok=True)
    sweep(out)
    with (
        _named_as_asked_for(),
        TemporaryDirectory(dir=out, prefix=f"{_UNFINISHED}{os.getpid()}-") as unfinished,
        _held(Path(unfinished)),
        named_in_utf8(Path(unfinished)) as folder,
    ):
        try:
            yield folder
        except ClutchestError as problem:  # name what was asked for, not the place of passage
            named = str(problem).replace(str(folder / "x")[:-1], str(out / "x")[:-1])
            raise ClutchestError(named) from problem
        finished = sorted(Path(unfinished).iterdir())
        for path in finished:
            if (out / path.name).is_dir():
                raise ClutchestError(f"{out / path.name}: is a folder, expected a file")
        whole = out / Path(unfinished).name.replace(_UNFINISHED, _FINISHED)
        Path(unfinished).rename(whole)
        _move(whole, out)


@contextmanager
def _named_as_asked_for() -> Iterator[None]:
    """What is refused to a place of passage is refused to the folder that it is in."""
    try:
        yield
    except OSError as problem:
        if isinstance(problem.filename, str):
            problem.filename = _PASSAGE.sub("", problem.filename)
        raise


def _move(whole: Path, out: Path) -> None:
    for path in sorted(whole.iterdir()):
        path.replace(out / path.name)
    whole.rmdir()


def sweep(out: Path) -> None:
    """Remove what processes left unfinished that were killed, and move what they had finished."""
    for start in (_UNFINISHED, _FINISHED):
        for left in out.glob(f"{start}*"):
            number = left.name.removeprefix(start).split("-")[0]
            if not number.isdigit() or _runs(int(number)):
                continue
            with suppress(FileNotFoundError), _held(left) as held:
                if held and start == _FINISHED:
                    _move(left, out)
                elif held:
                    rmtree(left, ignore_errors=True)


@contextmanager
def _held(folder: Path) -> Iterator[bool]:
    """Lock a folder as long as this process works in it; whether nobody else does."""
    try:
        import fcntl
    except ImportError:  # this platform has no such locks
        yield True
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        free = True
    except OSError:
        free = False
    try:
        yield free
    finally:
        os.close(handle)


def _runs(process: int) -> bool:
    """Whether another process of that number runs; in a container all may have the same one."""
    if process == os.getpid():
        return False
    if os.name != "posix":  # a signal of 0 would end it there
        return True
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        return True
    return True


def read_state(path: Path) -> dict[str, Any]:
    """What an earlier run left in its ``state.json``.  Raises ClutchestError naming the line."""
    try:
        within(path, STATE_BYTES, "a state.json")
        state = json.loads(path.read_text(encoding="utf-8"))
    except json.JSONDecodeError as problem:
        raise ClutchestError(
            f"{path}: line {problem.lineno}: not JSON: {problem.msg}; "
            "expected the state.json of an earlier replay"
        ) from None
    except OSError as problem:
        raise ClutchestError(f"{path}: cannot be read ({problem.strerror})") from None
    except UnicodeDecodeError:
        raise ClutchestError(
            f"{path}: not text; expected the state.json of an earlier replay"
        ) from None
    except (RecursionError, ValueError):  # nested without end, or a number of thousands of digits
        raise ClutchestError(
            f"{path}: damaged; expected the state.json of an earlier replay"
        ) from None
    if not isinstance(state, dict):
        raise ClutchestError(f"{path}: expected the state.json of an earlier replay, an object")
    return state


def write_estimates(run: Run, path: Path, only: int | None = None) -> None:
    """Write the estimates of all drives, or of one ``only``, as Parquet."""
    units = run.about(columns_of(run.tracks[0], 0, None))["units"]
    drives = range(len(run.tracks)) if only is None else [only]
    _write_tables(_estimates(run, drives), path, run.provenance, units)


def _estimates(run: Run, drives: Iterable[int]) -> Iterator[dict[str, Any]]:
    """The columns of every drive, a portion at a time; the mode by its name."""
    import pyarrow as pa

    logs = list(dict.fromkeys(map(log_of, run.signals.drives)))
    for drive in drives:
        track, signals = run.tracks[drive], run.signals.drives[drive]
        columns = columns_of(track, drive, signals.start_ns)
        log = logs.index(log_of(signals))
        for rows in _portions(len(track.time)):
            part = {name: column[rows] for name, column in columns.items()}
            part["mode"] = _named(part["mode"], track.mode_names)
            part["log"] = _named(np.full(len(part["log"]), log), logs)
            part["timestamp"] = pa.array(part["timestamp"], pa.timestamp("ns", "UTC"))
            yield part
            memory_mapped.release_memory()


def _innovations(run: Run) -> Iterator[dict[str, Any]]:
    for drive, track in enumerate(run.tracks):
        events = track.innovations
        for rows in _portions(len(events.time)):
            yield {
                "time": events.time[rows],
                "drive": np.full(len(events.time[rows]), drive, np.int32),
                "sensor": _named(events.sensor[rows], events.names),
                "innovation": events.innovation[rows],
                "std": events.std[rows],
            }
            memory_mapped.release_memory()


def _portions(n: int) -> Iterator[slice]:
    for first in range(0, max(n, 1), _PORTION):
        yield slice(first, first + _PORTION)


def _named(codes: NDArray, names: Sequence[str]) -> Any:
    """Names as the ``codes`` (n,) of a few."""
    import pyarrow as pa

    narrow = np.int8 if len(names) < 128 else np.int32
    return pa.DictionaryArray.from_arrays(codes.astype(narrow), list(names))


def _write_tables(
    tables: Iterable[Mapping[str, Any]],
    path: Path,
    provenance: Mapping[str, str],
    units: Mapping[str, str] | None = None,
) -> None:
    """Columns, portion after portion, as Parquet; ``provenance`` joins the metadata, one key
    each, and every field has its unit.  Numbers that hardly repeat have no dictionary: to look for
    one takes longer than to write them."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    from clutchest.reading.table_formats.parquet import with_units

    with ExitStack() as stack:
        writer = None
        for columns in tables:
            table = pa.table(dict(columns))
            if writer is None:
                schema = with_units(table.schema, units or {}).with_metadata(dict(provenance))
                few = [field.name for field in schema if not pa.types.is_floating(field.type)]
                kept = pq.ParquetWriter(path, schema, use_dictionary=few)
                writer = stack.enter_context(kept)
            writer.write_table(pa.Table.from_arrays(table.columns, schema=schema))
