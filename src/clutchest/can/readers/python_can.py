"""Every format without a reader of its own that python-can knows, plug-ins included; sqlite.

python-can holds times as float64 seconds, so stamps are good to 1 µs and are rounded to that.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from functools import cache
from importlib.metadata import entry_points
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from can.io.player import MESSAGE_READERS

from can import LogReader, Message, SqliteReader
from clutchest.can.frames import Flag, Frames, Tally
from clutchest.can.readers import LAST_S, counts_from_epoch, sqlite_pages
from clutchest.can.readers.stream import Source, opened, quiet
from clutchest.errors import ClutchestError

_OWN = {".asc", ".blf", ".csv", ".log", ".mf4", ".trc"}
_BLOCK = 100_000  # frames
_LARGEST_ZIPPED = 1 << 30  # bytes, inflated
_BROKEN = "file is damaged or ends early"
_UNSOUND = "frame has no sound id, length or time"


def knows(path: Path) -> bool:
    """Whether python-can, or a plug-in of it, reads files with this suffix."""
    return path.suffix.lower() in _suffixes()


@cache
def _suffixes() -> frozenset[str]:
    plugged = {plug.name for plug in entry_points(group="can.io.message_reader")}
    return frozenset((set(MESSAGE_READERS) | plugged) - _OWN)


def read(source: Source) -> Iterator[Frames]:
    """Frames as python-can reads them; what stands before a damaged place is kept, and in SQLite
    what stands behind it."""
    is_sqlite = source.head[:15] == b"SQLite format 3"
    if source.zipped and is_sqlite:
        with TemporaryDirectory(prefix="clutchest-") as folder:
            plain = Path(folder) / source.path.stem
            plain.write_bytes(source.everything(_LARGEST_ZIPPED))
            with opened(plain) as unpacked:
                yield from read(unpacked)
        return
    if source.zipped:
        raise ClutchestError(f"{source.path}: this format cannot be read gzipped, unpack it first")
    absolute, count = None, 0
    for columns, rejected in _columns(source, is_sqlite):
        frames = columns.frames(rejected)
        count += len(frames)
        if absolute is None and len(frames):
            absolute = counts_from_epoch(frames.t_ns)
        yield replace(frames, absolute=absolute is not False)
        if is_sqlite and any(why == _BROKEN for why, _ in rejected):
            for more in _rest(source, count):
                yield replace(more.frames(()), absolute=absolute is not False)


def _columns(source: Source, is_sqlite: bool) -> Iterator[tuple[_Columns, Tally]]:
    """Blocks of messages, and what is wrong behind each."""
    with quiet("can"):
        try:
            reader = SqliteReader(source.path) if is_sqlite else LogReader(source.path)
        except Exception as error:  # every format's library has its own
            if is_sqlite:
                yield _Columns(), ((_BROKEN, 1),)
                return
            raise ClutchestError(
                f"{source.path}: the file is damaged ({type(error).__name__}: {error})"
            ) from None
        with reader:
            messages, reading = iter(reader), True
            while reading:
                columns, broken = _Columns(), False
                try:
                    for message in islice(messages, _BLOCK):
                        columns.add(message)
                    reading = len(columns.rows) + columns.unsound == _BLOCK
                except Exception:
                    reading, broken = False, True
                unsound = ((_UNSOUND, columns.unsound),) if columns.unsound else ()
                yield columns, (*unsound, (_BROKEN, 1)) if broken else unsound


def _rest(source: Source, count: int) -> Iterator[_Columns]:
    """The messages behind the first ``count``, from the pages that are whole."""
    columns = _Columns()
    for rowid, values in sqlite_pages.rows(source):
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
        if len(columns.rows) == _BLOCK:
            yield columns
            columns = _Columns()
    yield columns


class _Columns:
    """Messages of python-can, collected into the columns of Frames."""

    def __init__(self) -> None:
        self.rows: list[tuple[int, int, int, int, int]] = []
        self.payloads: list[bytes] = []
        self.unsound = 0

    def add(self, message: Message) -> None:
        data = bytes(message.data)
        length = message.dlc if message.is_remote_frame else len(data)
        if not (
            0 <= length <= 64
            and len(data) <= 64
            and 0 <= message.arbitration_id < 1 << 29
            and abs(message.timestamp) < LAST_S
        ):
            self.unsound += 1
            return
        flags = 0
        if message.is_error_frame:
            flags |= Flag.ERROR
        elif message.is_extended_id:
            flags |= Flag.EXTENDED
        if message.is_remote_frame:
            flags |= Flag.REMOTE
        if message.is_fd:
            flags |= Flag.FD
        if message.bitrate_switch:
            flags |= Flag.BITRATE_SWITCH
        if message.error_state_indicator:
            flags |= Flag.ERROR_STATE
        if not message.is_rx:
            flags |= Flag.SENT
        channel = message.channel if isinstance(message.channel, int) else 0
        self.rows.append(
            (
                round(message.timestamp * 1e6) * 1000,
                message.arbitration_id,
                flags,
                length,
                max(channel, 0),
            )
        )
        self.payloads.append(data)

    def frames(self, rejected: Tally) -> Frames:
        width = 8 if all(len(data) <= 8 for data in self.payloads) else 64
        columns = np.array(self.rows, np.int64).reshape(-1, 5).T
        data = np.frombuffer(b"".join(data.ljust(width, b"\0") for data in self.payloads), np.uint8)
        return Frames(
            np.ascontiguousarray(columns[0]),
            columns[4].astype(np.uint8),
            columns[1].astype(np.uint32),
            columns[2].astype(np.uint8),
            columns[3].astype(np.uint8),
            data.reshape(-1, width),
            rejected=rejected,
        )
