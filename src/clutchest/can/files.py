"""Log files: any format in, columns out, and back.

A log is known by its content, so a wrong suffix does no harm: Vector blf and asc, PEAK trc,
candump in both layouts, MDF4 bus logging, csv and sqlite of python-can; each also gzipped.
"""

from __future__ import annotations

import gzip
import re
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from shutil import copyfileobj
from tempfile import TemporaryDirectory
from typing import BinaryIO

import numpy as np

from clutchest.can.frames import Flag, Frames
from clutchest.can.readers import stream
from clutchest.can.readers.stream import Source
from clutchest.errors import ClutchestError, nearest

_EXPECTED = "candump (.log), .asc, .blf, .trc, .csv or .db of python-can or .mf4, each also .gz"
_TEXT = (".log", ".asc", ".trc", ".csv")
_WRITABLE = (*_TEXT, ".blf", ".mf4", ".db")

# First line that matches says what a text log is.
_SIGNS = {
    "candump": re.compile(rb"^[ \t]*\(\d+\.\d+\)[ \t]+\S+[ \t]", re.MULTILINE),
    "csv": re.compile(rb"^timestamp,arbitration_id,extended,remote,error,dlc,data", re.MULTILINE),
    "trc": re.compile(rb"^;(\$FILEVERSION|[ \t]*PCAN|##|[ \t]*Message Number|---\+)", re.MULTILINE),
    "asc": re.compile(
        rb"^(date[ \t]|base[ \t]+(hex|dec)|begin triggerblock)", re.MULTILINE | re.IGNORECASE
    ),
}

Reader = Callable[[Source], Iterator[Frames]]


def read_blocks(path: Path) -> Iterator[Frames]:
    """The frames of a log block by block, in the order of the file (mf4: of time).

    Lines or objects that cannot be read are counted in ``Frames.rejected`` of their block; all
    blocks agree on ``absolute``.  Raises ClutchestError for a file that does not exist, is empty,
    or holds no frame at all.
    """
    with stream.opened(Path(path)) as source:
        yield from blocks_of(source)


def blocks_of(source: Source) -> Iterator[Frames]:
    """As :func:`read_blocks`, of a log that is already open."""
    if not source.head.strip():
        raise ClutchestError(f"{source.path}: the file is empty; expected a CAN log: {_EXPECTED}")
    rejected: Counter[str] = Counter()
    empty = 0  # blocks in a row
    found, absolute = False, True
    for frames in _reader(source)(source):
        rejected.update(dict(frames.rejected))
        empty = 0 if len(frames) else empty + 1
        found, absolute = found or not empty, frames.absolute
        yield frames
        if empty == stream.HOPELESS:
            source.rejected["nothing readable for long, the rest left unread"] += 1
            break
    if source.cut:
        source.rejected[stream.GZIP_CUT] += 1
    if not found:
        rejected.update(source.rejected)
        told = [f"{count} × {reason}" for reason, count in rejected.items()]
        why = ": " + ", ".join(told) if told else ""
        raise ClutchestError(f"{source.path}: no CAN frame could be read{why}")
    if source.rejected:
        yield Frames.empty(absolute=absolute, rejected=tuple(source.rejected.items()))


def read_frames(path: Path) -> Frames:
    """All frames of a log at once; see :func:`read_blocks`."""
    return Frames.concatenate(read_blocks(path))


def write_frames(frames: Frames, path: Path) -> tuple[str, ...]:
    """Writes a log in the format that the suffix names, with ``.gz`` behind it compressed.

    Times are kept to 1 ns.  Gives back what the format could not keep, in words, empty if it is all
    there.  Raises ClutchestError for a suffix that is not known and for a path that cannot be
    written.
    """
    path = Path(path)
    zipped = path.suffix.lower() == ".gz"
    suffix = Path(path.stem).suffix.lower() if zipped else path.suffix.lower()
    if suffix not in _WRITABLE:
        given = suffix + ".gz" if zipped else suffix
        valid = tuple(known + ".gz" for known in _WRITABLE) if zipped else _WRITABLE
        raise ClutchestError(
            f"{path}: no log format has the suffix '{given}'" + nearest(given, valid)
        )
    try:
        if suffix in _TEXT:
            with _file(path, zipped) as file:
                file.writelines(_text(frames, suffix))
        elif not zipped:
            _binary(frames, suffix, path)
        else:
            with TemporaryDirectory(dir=path.parent, prefix=".clutchest-") as folder:
                plain = Path(folder) / path.stem
                _binary(frames, suffix, plain)
                with plain.open("rb") as whole, _file(path, zipped) as file:
                    copyfileobj(whole, file)
    except OSError as error:
        raise ClutchestError(f"{path}: cannot be written ({error.strerror or error})") from None
    return _losses(frames, suffix)


@contextmanager
def _file(path: Path, zipped: bool) -> Iterator[BinaryIO | gzip.GzipFile]:
    with path.open("wb") as file:
        if zipped:  # without name and time in it: the same frames are the same file
            with gzip.GzipFile("", "wb", 6, file, mtime=0) as packed:
                yield packed
        else:
            yield file


def _binary(frames: Frames, suffix: str, path: Path) -> None:
    if suffix == ".blf":
        from clutchest.can.writers import blf

        blf.write(frames, path)
    elif suffix == ".mf4":
        from clutchest.can.writers import mf4

        mf4.write(frames, path)
    else:
        from clutchest.can.writers import sqlite

        sqlite.write(frames, path)


def _text(frames: Frames, suffix: str) -> Iterator[bytes]:
    from clutchest.can.writers import asc, candump, csv, trc

    writers = {".log": candump.write, ".asc": asc.write, ".trc": trc.write, ".csv": csv.write}
    return writers[suffix](frames)


def _losses(frames: Frames, suffix: str) -> tuple[str, ...]:
    """What a format has no place for."""
    losses = []
    if suffix == ".trc" and (errors := np.count_nonzero(frames.flags & Flag.ERROR)):
        losses.append(f".trc cannot hold {errors} error frames")
    if suffix in (".csv", ".db"):
        if len(np.unique(frames.channel)) > 1:
            losses.append(f"{suffix} cannot tell the channels apart")
        if np.any(frames.flags & (Flag.BITRATE_SWITCH | Flag.ERROR_STATE | Flag.SENT)):
            losses.append(f"{suffix} cannot hold direction, bit rate switch and error state")
    if suffix == ".db":
        if np.any(frames.t_ns % 1000):
            losses.append(".db holds times to 1 µs")
        if np.any((frames.length <= 8) & ((frames.flags & Flag.FD) != 0)):
            losses.append(".db cannot tell FD frames of 8 bytes or less from others")
    return tuple(losses)


def _reader(source: Source) -> Reader:
    """What reads this content; the libraries load only for the format that needs them."""
    from clutchest.can.readers import asc, blf, candump, csv, trc

    head = source.head
    if head[:4] == b"LOGG":
        return blf.read
    if head[:8] in (b"MDF     ", b"UnFinMF "):
        from clutchest.can.readers import mf4

        return mf4.read
    found = {name: match.start() for name, sign in _SIGNS.items() if (match := sign.search(head))}
    if found:
        texts = {"candump": candump.read, "csv": csv.read, "trc": trc.read, "asc": asc.read}
        return texts[min(found, key=lambda key: found[key])]
    from clutchest.can.readers import python_can

    if head[:15] == b"SQLite format 3" or python_can.knows(source.path):
        return python_can.read
    first = head.lstrip()[:60].splitlines()[0].decode("utf-8", "replace")
    raise ClutchestError(
        f"{source.path}: not a CAN log that is known; it begins with {first!r}; "
        f"expected {_EXPECTED}"
    )
