"""Log files: any format in, columns out, and back.

A log is known by its content, so a wrong suffix does no harm: Vector blf and asc, PEAK trc,
candump in both layouts, MDF4 bus logging, csv and sqlite of python-can; each also gzipped.
"""

from __future__ import annotations

import gzip
import re
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from clutchest.can.frames import Frames
from clutchest.errors import ClutchestError, nearest

_EXPECTED = "candump (.log), .asc, .blf, .trc, .csv of python-can or .mf4, each also .gz"
_WRITABLE = (".log", ".asc", ".blf", ".trc", ".csv", ".mf4")
_TEXT = (".log", ".asc", ".trc", ".csv")

# First line that matches says what a text log is.
_SIGNS = {
    "candump": re.compile(rb"^[ \t]*\(\d+\.\d+\)[ \t]+\S+[ \t]", re.MULTILINE),
    "csv": re.compile(rb"^timestamp,arbitration_id,extended,remote,error,dlc,data", re.MULTILINE),
    "trc": re.compile(rb"^;(\$FILEVERSION|[ \t]*PCAN|##|[ \t]*Message Number|---\+)", re.MULTILINE),
    "asc": re.compile(rb"^(date[ \t]|base[ \t]+(hex|dec)|begin triggerblock)",
                      re.MULTILINE | re.IGNORECASE),
}  # fmt: skip


def read_frames(path: Path) -> Frames:
    """All frames of a log, in the order of the file (mf4: of time).

    Lines or objects that cannot be read are counted in ``Frames.rejected``.  Raises
    ClutchestError for a file that does not exist, is empty, or holds no frame at all.
    """
    path = Path(path)
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ClutchestError(f"{path}: cannot be read ({error.strerror})") from None
    cut = False
    if content[:2] == b"\x1f\x8b":
        content, cut = _unzipped(content, path)
    if not content.strip():
        raise ClutchestError(f"{path}: the file is empty; expected a CAN log: {_EXPECTED}")
    reader = _reader(content, path)
    try:
        frames = reader()
    except ClutchestError:
        raise
    except Exception as error:  # every format's library has its own
        raise ClutchestError(f"{path}: the file is damaged "
                             f"({type(error).__name__}: {error})") from None  # fmt: skip
    if not len(frames):
        why = ", ".join(f"{count} × {reason}" for reason, count in frames.rejected)
        raise ClutchestError(f"{path}: no CAN frame could be read" + (f": {why}" if why else ""))
    if cut:
        frames = replace(frames, rejected=(*frames.rejected, ("gzip data end early", 1)))
    return frames


def write_frames(frames: Frames, path: Path) -> tuple[str, ...]:
    """Writes a log in the format that the suffix names; text formats also as ``.gz``.

    candump and mf4 keep times to 1 ns, the others to 1 µs.  Gives back what else the format could
    not keep, in words, empty if it is all there.  Raises ClutchestError for a suffix that
    is not known, for a format that cannot hold these frames, and for a path that cannot be written.
    """
    path = Path(path)
    zipped = path.suffix.lower() == ".gz"
    suffix = Path(path.stem).suffix.lower() if zipped else path.suffix.lower()
    if suffix not in (_TEXT if zipped else _WRITABLE):
        given = suffix + ".gz" if zipped else suffix
        valid = (*_WRITABLE, *(text + ".gz" for text in _TEXT))
        raise ClutchestError(f"{path}: no log format has the suffix '{given}'"
                             + nearest(given, valid))  # fmt: skip
    target = path.with_name(path.name + ".unzipped" + suffix) if zipped else path
    try:
        losses = _write(frames, target, suffix)
        if zipped:
            path.write_bytes(gzip.compress(target.read_bytes(), mtime=0))
    except OSError as error:
        raise ClutchestError(f"{path}: cannot be written ({error.strerror or error})") from None
    finally:
        if zipped:
            target.unlink(missing_ok=True)
    return losses


def _write(frames: Frames, path: Path, suffix: str) -> tuple[str, ...]:
    if suffix == ".log":
        from clutchest.can.writers import candump

        with path.open("wb") as file:
            file.writelines(candump.write(frames))
        return ()
    if suffix == ".mf4":
        from clutchest.can.writers import mf4

        mf4.write(frames, path)
        return ()
    from clutchest.can.writers import python_can

    return python_can.WRITERS[suffix](frames, path)


def _unzipped(content: bytes, path: Path) -> tuple[bytes, bool]:
    """What gzip holds, as far as it goes, and whether it ended early."""
    parts, rest = [], content
    try:
        while rest:
            stream = zlib.decompressobj(wbits=31)
            parts.append(stream.decompress(rest))
            if not stream.eof:
                return b"".join(parts), True
            rest = stream.unused_data.lstrip(b"\0")
    except zlib.error as error:
        if not any(parts):
            raise ClutchestError(f"{path}: damaged gzip data ({error})") from None
        return b"".join(parts), True
    return b"".join(parts), False


def _reader(content: bytes, path: Path) -> Callable[[], Frames]:
    """What reads this content; the libraries load only for the format that needs them."""
    if content[:4] == b"LOGG":
        from clutchest.can.readers import python_can

        return lambda: python_can.read_blf(content)
    if content[:8] in (b"MDF     ", b"UnFinMF "):
        from clutchest.can.readers import mf4

        return lambda: mf4.read(content)
    if content[:15] == b"SQLite format 3":
        from clutchest.can.readers import python_can

        return lambda: python_can.read_sqlite(path)
    head = content[:100_000]
    found = {name: match.start() for name, sign in _SIGNS.items() if (match := sign.search(head))}
    if not found:
        first = content.lstrip()[:60].splitlines()[0].decode("utf-8", "replace")
        raise ClutchestError(f"{path}: not a CAN log that is known; it begins with {first!r}; "
                             f"expected {_EXPECTED}")  # fmt: skip
    name = min(found, key=lambda key: found[key])
    if name == "candump":
        from clutchest.can.readers import candump

        return lambda: candump.read(content)
    from clutchest.can.readers import python_can

    text = content.decode("utf-8", "replace")
    read = {"asc": python_can.read_asc, "trc": python_can.read_trc, "csv": python_can.read_csv}
    return lambda: read[name](text)
