"""Which logs there are, and whose they are."""

from __future__ import annotations

import glob
import hashlib
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path

from clutchest.can import log_source
from clutchest.can.formats import log_formats
from clutchest.errors import ClutchestError
from clutchest.paths import as_written, readable
from clutchest.reading.table_formats import read_suffixes
from clutchest.shipped import shipped, shipped_file

TEXT = ".txt"  # of a log, and of whatever somebody notes beside it
_EXPECTED = "expected a folder of logs, a pattern or a shipped log: "
AGAIN = ".truth.parquet"  # beside a simulated log: not a log


@dataclass(frozen=True, slots=True)
class FleetLog:
    """One log: its ``path`` and the ``vehicle`` that it is of."""

    path: Path
    vehicle: str

    def key(self, made_by: str) -> str:
        """What its results are kept under: another one where the log, its place, or ``made_by``
        (the log before it, vehicle file and version) is another."""
        about = self.path.stat()
        text = f"{self.vehicle} {self.path} {about.st_size} {about.st_mtime_ns} {made_by}"
        return hashlib.sha256(readable(text).encode()).hexdigest()[:24]


def logs_of(places: Sequence[str | Path], out: Path | None = None) -> tuple[FleetLog, ...]:
    """Every log in folders, at any depth, and of patterns, single files and names of shipped logs,
    each once; what lies in ``out``, results of a run before, is none.

    The folder below the one that is given names the vehicle; of logs that lie directly in it, and
    of single files, the folder they lie in does; a shipped log is of a vehicle of its own name.
    Raises ClutchestError for a place where there is none.
    """
    found: dict[Path, FleetLog] = {}
    if not places:
        raise ClutchestError(f"no place of logs is given; {_EXPECTED}" + ", ".join(shipped("logs")))
    for place in map(str, map(as_written, places)):
        logs = [log for log in _logs_at(place) if out not in log.path.resolve().parents]
        if not logs:
            raise ClutchestError(f"{place}: no log there; {_EXPECTED}" + ", ".join(shipped("logs")))
        for log in logs:
            found.setdefault(log.path.resolve(), log)
    return tuple(sorted(found.values(), key=lambda log: (log.vehicle, log.path)))


def numbered(path: Path) -> tuple[tuple[str, int], ...]:
    """What sorts paths by the numbers in them: run 2 before run 10."""
    parts = re.split(r"(\d+)", str(path))
    return tuple((text, int(digits or 0)) for text, digits in zip_longest(parts[::2], parts[1::2]))


def _logs_at(place: str) -> Iterator[FleetLog]:
    path = Path(place)
    if path.is_dir():
        for file in _known(path.rglob("*")):
            below = file.relative_to(path).parts
            yield FleetLog(file, readable(below[0] if len(below) > 1 else path.resolve().name))
        return
    files = [path] if path.is_file() else [Path(name) for name in _matching(place)]
    stock = None if files else shipped_file(place, "logs")
    if stock is not None:
        yield FleetLog(stock, stock.name.split(".")[0])
    for file in files:
        if file.is_dir():
            yield from _logs_at(str(file))
        elif not file.name.endswith(AGAIN):
            yield FleetLog(file, readable(file.resolve().parent.name))


def _matching(pattern: str) -> list[str]:
    """Paths that a pattern with ``*``, ``?`` and ``**`` matches."""
    return sorted(glob.glob(pattern, recursive=True))  # noqa: PTH207 - absolute patterns too


def _known(files: Iterable[Path]) -> Iterator[Path]:
    """Those whose suffix is that of a log, in order of their names."""
    suffixes = {entry.suffix for entry in log_formats() if entry.suffix} | read_suffixes()
    for file in sorted(files):
        plain = file.name.lower().removesuffix(".gz")
        if not file.is_file() or Path(plain).suffix not in suffixes or plain.endswith(AGAIN):
            continue
        if Path(plain).suffix != TEXT or _is_log(file):
            yield file


def _is_log(file: Path) -> bool:
    """Whether its content is that of a log."""
    try:
        with log_source.opened(file) as source:
            return any(entry.sniff(source.head) is not None for entry in log_formats())
    except (ClutchestError, OSError):
        return False
