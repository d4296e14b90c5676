"""Every format that python-can reads: asc, blf, trc, its own csv and sqlite logs.

python-can holds times as float64 seconds, so stamps are good to 1 µs and are rounded to that.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from io import BytesIO
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from can import ASCReader, BLFReader, CSVReader, Message, SqliteReader, TRCReader
from clutchest.can.frames import Flag, Frames
from clutchest.can.readers import counts_from_epoch

_UNREADABLE = "line cannot be read"
_NO_FRAME = "no CAN frame in this line"
_BROKEN = "file is damaged or ends early"


def read_asc(text: str) -> Frames:
    """Vector's text log.  Its date makes the stamps absolute."""
    lines = _plain_asc(text.splitlines(keepends=True))
    return _read_lines(lines, lambda source: ASCReader(source, relative_timestamp=False))


def read_trc(text: str) -> Frames:
    """PEAK's text log, versions 1.0 to 2.1.  Its start time makes the stamps absolute."""
    return _read_lines(text.splitlines(keepends=True), TRCReader, first_channel=1)


def read_csv(text: str) -> Frames:
    """The csv that python-can writes; it knows no channels."""
    return _read_lines(text.splitlines(keepends=True), CSVReader)


def read_blf(content: bytes) -> Frames:
    """Vector's binary log.  What stands before a damaged place is kept."""
    columns = _Columns()
    try:
        with _quiet():
            reader = BLFReader(BytesIO(content))
            columns.extend(reader)
    except Exception:  # zlib, struct and python-can each have their own
        columns.reject(_BROKEN)
    else:
        if reader.file_size > len(content):
            columns.reject(_BROKEN)
    return columns.frames()


def read_sqlite(path: Path) -> Frames:
    """python-can's sqlite log."""
    columns = _Columns()
    with _quiet(), SqliteReader(path) as reader:
        columns.extend(reader)
    return columns.frames()


class _Lines:
    """A text file that can be taken up again behind the line on which a reader failed."""

    def __init__(self, lines: list[str]) -> None:
        self.lines = lines
        self.at = 0
        self.header: Iterator[str] = iter([])

    def __iter__(self) -> Iterator[str]:
        return self

    def __next__(self) -> str:
        for line in self.header:
            return line
        if self.at == len(self.lines):
            raise StopIteration
        self.at += 1
        return self.lines[self.at - 1]

    def close(self) -> None:
        """Readers close their file when they are through."""


def _read_lines(lines: list[str], make: Callable[[Any], Iterable[Message]],
                first_channel: int = 0) -> Frames:  # fmt: skip
    """All frames; a line that makes the reader fail is counted and the next reader goes on."""
    source, columns = _Lines(lines), _Columns(first_channel)
    header: int | None = None  # how many lines stand before the first frame
    done = failed_at = -1
    with _quiet():
        while failed_at < source.at:
            failed_at = source.at
            try:
                for message in make(source):
                    header = source.at - 1 if header is None else header
                    columns.reject(_NO_FRAME, _lost(lines[max(done, header) : source.at - 1]))
                    done = source.at
                    columns.add(message)
            except Exception:  # whatever python-can lets through for a broken line
                header = source.at - 1 if header is None else header
                columns.reject(_UNREADABLE)
                columns.reject(_NO_FRAME, _lost(lines[max(done, header) : source.at - 1]))
                done = source.at
                source.header = iter(lines[:header])
            else:
                break
    columns.reject(_NO_FRAME, _lost(lines[max(done, header or 0) : source.at]))
    return columns.frames()


_IDLE = re.compile(r"\s*$|\s*//|\s*;|(begin|end) triggerblock|\s*[\d.]+\s+start of measurement",
                   re.IGNORECASE)  # fmt: skip


def _lost(lines: list[str]) -> int:
    """How many lines that a reader passed over are neither comments nor marks."""
    return sum(not _IDLE.match(line) for line in lines)


_ASC_HEADER = re.compile(r"date\s|base\s|.*internal events logged", re.IGNORECASE)
_ASC_STAMP = re.compile(r"\s*(\d+\.\d+)")


def _plain_asc(lines: list[str]) -> list[str]:
    """The header as python-can wants it — it swallows the line behind a header that lacks the
    mention of internal events — and stamps that count from the line before added up."""
    header = {line.split()[0].lower(): line for line in lines[:50] if _ASC_HEADER.match(line)}
    body = (line for line in lines if not _ASC_HEADER.match(line))
    deltas = "relative" in header.get("base", "").lower()
    if deltas:
        header["base"] = header["base"].lower().replace("relative", "absolute")
    kept = (header[key] for key in ("date", "base") if key in header)
    return list(chain(kept, ["no internal events logged\n"], _added_up(body) if deltas else body))


def _added_up(lines: Iterable[str]) -> Iterator[str]:
    now_us = 0
    for line in lines:
        stamp = _ASC_STAMP.match(line)
        if stamp:
            now_us += round(float(stamp[1]) * 1e6)
            line = f"{now_us / 1e6:.6f}{line[stamp.end() :]}"
        yield line


class _Columns:
    """Messages of python-can, collected into the columns of Frames."""

    def __init__(self, first_channel: int = 0) -> None:
        self.first_channel = first_channel
        self.rows: list[tuple[int, int, int, int, int]] = []
        self.payloads: list[bytes] = []
        self.rejected: dict[str, int] = {}

    def reject(self, reason: str, count: int = 1) -> None:
        if count:
            self.rejected[reason] = self.rejected.get(reason, 0) + count

    def extend(self, messages: Iterable[Message]) -> None:
        for message in messages:
            self.add(message)

    def add(self, message: Message) -> None:
        flags = 0
        if message.is_error_frame:
            flags |= Flag.ERROR
        elif message.is_extended_id:
            flags |= Flag.EXTENDED
        if message.is_remote_frame:
            flags |= Flag.REMOTE
        if message.is_fd or len(message.data) > 8:  # csv does not say
            flags |= Flag.FD
        if message.bitrate_switch:
            flags |= Flag.BITRATE_SWITCH
        if message.error_state_indicator:
            flags |= Flag.ERROR_STATE
        if not message.is_rx:
            flags |= Flag.SENT
        channel = message.channel if isinstance(message.channel, int) else self.first_channel
        data = bytes(message.data)
        length = message.dlc if message.is_remote_frame else len(data)
        self.rows.append((round(message.timestamp * 1e6) * 1000, message.arbitration_id, flags,
                          length, max(channel - self.first_channel, 0)))  # fmt: skip
        self.payloads.append(data)

    def frames(self) -> Frames:
        width = 8 if all(len(data) <= 8 for data in self.payloads) else 64
        columns = np.array(self.rows, np.int64).reshape(-1, 5).T
        data = np.frombuffer(b"".join(data.ljust(width, b"\0") for data in self.payloads), np.uint8)
        return Frames(np.ascontiguousarray(columns[0]), columns[4].astype(np.uint8),
                      columns[1].astype(np.uint32), columns[2].astype(np.uint8),
                      columns[3].astype(np.uint8), data.reshape(-1, width),
                      counts_from_epoch(columns[0]), tuple(self.rejected.items()))  # fmt: skip


@contextmanager
def _quiet() -> Iterator[None]:
    """python-can logs every broken line; here they are counted instead."""
    logger = logging.getLogger("can")
    level = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        logger.setLevel(level)
