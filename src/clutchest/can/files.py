"""Log files: any format in, columns out, and back.

A log is recognised by its content, so a wrong suffix does no harm.  The formats are those of
:mod:`clutchest.can.formats`; each may be gzipped.
"""

from __future__ import annotations

import gzip
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from shutil import copyfileobj
from tempfile import TemporaryDirectory
from typing import BinaryIO

from clutchest import budgets
from clutchest.can import log_source
from clutchest.can.formats import log_formats
from clutchest.can.frames import Frames
from clutchest.can.log_format import LogFormat
from clutchest.can.log_source import LogSource
from clutchest.checked import checked
from clutchest.errors import ClutchestError, nearest

_BESIDE = 15  # bytes of a frame beside its data
_BINARY = re.compile(rb"[\0-\x08\x0b\x0e-\x1f]")  # no text has these
_FIRST = 4096  # bytes in which most formats show; to search all of the head takes milliseconds


@checked
def read_blocks(path: str | Path, also: str = "") -> Iterator[Frames]:
    """The frames of a log block by block, in the order of the file (mf4: of time).

    Lines or objects that cannot be read are counted in ``Frames.rejected`` of their block; all
    blocks agree on ``absolute``.  ``also``: what the caller takes besides CAN logs, in words, for
    its error messages.  Raises ClutchestError for a file that does not exist, is empty, holds no
    frame at all, or inflates beyond its budget.
    """
    path = Path(path)
    seen = 0
    with log_source.opened(path) as source:
        most = max(budgets.LOG_FRAMES, path.stat().st_size)
        most_bytes = budgets.by_size(path, budgets.LOG_RATIO)
        for block in blocks_of(source, also):
            seen += len(block)
            if seen > most or source.position > most_bytes:
                raise _too_many(path, most)
            yield block


def held(path: Path, blocks: Iterable[Frames]) -> Iterator[Frames]:
    """``blocks`` of a log that are to be held together.  Raises ClutchestError beyond the budget of
    its file."""
    frames, width, budget = 0, 0, budgets.by_size(path, budgets.HELD_BYTES)
    for block in blocks:
        frames, width = frames + len(block), max(width, block.data.shape[1])
        if frames * (width + _BESIDE) > budget:
            raise _too_many(path, budget // (width + _BESIDE))
        yield block


def _too_many(path: Path, most: int) -> ClutchestError:
    return ClutchestError(
        f"{path}: holds more than {most / 1e6:.3g} million frames; expected fewer of a file of "
        f"{path.stat().st_size / 1e6:.3g} MB: unpack it, or cut it into drives"
    )


def blocks_of(source: LogSource, also: str = "") -> Iterator[Frames]:
    """As :func:`read_blocks`, of a log that is already open."""
    if not source.head.strip():
        raise ClutchestError(f"{source.path}: the file is empty; expected {_expected(also)}")
    rejected: Counter[str] = Counter()
    empty = 0  # blocks in a row
    any_frame, absolute = False, True
    for frames in format_of(source, also).read(source):
        rejected.update(dict(frames.rejected))
        empty = 0 if len(frames) else empty + 1
        any_frame, absolute = any_frame or not empty, frames.absolute
        yield frames
        if empty == log_source.HOPELESS:
            source.rejected["nothing readable for long, the rest left unread"] += 1
            break
    if source.truncated:
        source.rejected[log_source.GZIP_TRUNCATED] += 1
    if not any_frame:
        rejected.update(source.rejected)
        reasons = [f"{count} × {reason}" for reason, count in rejected.items()]
        why = ": " + ", ".join(reasons) if reasons else ""
        raise ClutchestError(f"{source.path}: no CAN frame could be read{why}")
    if source.rejected:
        yield Frames.empty(absolute=absolute, rejected=tuple(source.rejected.items()))


def is_log(path: Path) -> bool:
    """Whether the file begins like one of the formats."""
    try:
        with log_source.opened(path) as source:
            return bool(source.head.strip() and format_of(source))
    except ClutchestError:
        return False


@checked
def read_frames(path: str | Path, also: str = "") -> Frames:
    """All frames of a log at once; see :func:`read_blocks`."""
    return Frames.concatenate(read_blocks(path, also))


@checked
def write_frames(frames: Frames, path: str | Path) -> tuple[str, ...]:
    """Writes a log in the format that the suffix names, with ``.gz`` behind it compressed.

    Times are kept to 1 ns.  Gives back what the format could not keep, in words, empty if it is all
    there.  Raises ClutchestError for a suffix that is not known and for a path that cannot be
    written.
    """
    path = Path(path)
    zipped = path.suffix.lower() == ".gz"
    suffix = Path(path.stem).suffix.lower() if zipped else path.suffix.lower()
    known = {entry.suffix: entry for entry in log_formats() if entry.writable}
    if suffix not in known:
        end = ".gz" if zipped else ""
        raise ClutchestError(
            f"{path}: no log format has the suffix '{suffix + end}'"
            + nearest(suffix + end, [valid + end for valid in known])
        )
    entry = known[suffix]
    try:
        if entry.lines:
            with _file(path, zipped) as file:
                file.writelines(entry.lines(frames))
        elif entry.save and not zipped:
            entry.save(frames, path)
        elif entry.save:
            with TemporaryDirectory(dir=path.parent, prefix=".clutchest-") as folder:
                plain = Path(folder) / path.stem
                entry.save(frames, plain)
                with plain.open("rb") as whole, _file(path, zipped) as file:
                    copyfileobj(whole, file)
    except OSError as error:
        raise ClutchestError(f"{path}: cannot be written ({error.strerror or error})") from None
    return entry.lost(frames)


@contextmanager
def _file(path: Path, zipped: bool) -> Iterator[BinaryIO | gzip.GzipFile]:
    with path.open("wb") as file:
        if zipped:  # without name and time in it: the same frames are the same file
            with gzip.GzipFile("", "wb", 6, file, mtime=0) as packed:
                yield packed
        else:
            yield file


def format_of(source: LogSource, also: str = "") -> LogFormat:
    """The format of an open log: by its content, else by its suffix.

    Raises ClutchestError where neither is known; ``also`` as in :func:`read_blocks`.
    """
    for head in (source.head[:_FIRST], source.head):
        places = [(at, entry) for entry in log_formats() if (at := entry.sniff(head)) is not None]
        if places:
            return min(places, key=lambda place: place[0])[1]
    suffix = source.path.suffix.lower()
    own = [entry for entry in log_formats() if entry.suffix == suffix]
    for entry in own or log_formats():
        if entry.by_suffix(suffix):
            return entry
    first = source.head.lstrip()[:60].splitlines()[0]
    binary = _BINARY.search(source.head[:_FIRST])
    words = "binary data" if binary else repr(first.decode("utf-8", "replace"))
    raise ClutchestError(
        f"{source.path}: not a CAN log that is known; it begins with {words}; "
        f"expected {_expected(also)}"
    )


def _expected(also: str) -> str:
    """The formats in words, and what else the caller takes."""
    *titles, last = [entry.title for entry in log_formats() if entry.writable]
    logs = f"a CAN log ({', '.join(titles)} or {last}, each also .gz)"
    return f"{logs} or {also}" if also else logs
