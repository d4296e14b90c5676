"""The bytes of a log: opened, inflated, split into blocks; never more in memory than one block.

The size that a file states is never relied upon: gzip data are inflated as far as the
next block needs, a line without an end is dropped, and a file that shows nothing readable for
``HOPELESS`` blocks is given up.
"""

from __future__ import annotations

import codecs
import logging
import zlib as plain_zlib
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import IO, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from clutchest.errors import ClutchestError

try:  # several times quicker; not built for every processor
    zlib: Any = import_module("isal.isal_zlib")
except ImportError:
    zlib = plain_zlib

BLOCK = 1 << 20  # bytes of text or of inflated objects that are processed together
HEAD = 100_000  # bytes by which a format is known
HOPELESS = 256  # blocks without a frame; more of the same is no log
BAD_DATA: tuple[type[Exception], ...] = (plain_zlib.error, zlib.error)

_PIECE = 64 << 10  # bytes of compressed data at a time
SURE = 32  # bytes, by which a text is known to be in UTF-16 without a mark
_WHITE = b"\t\r\n"
GZIP_TRUNCATED = "gzip data end early"
_LONG_LINE = f"line longer than {BLOCK >> 20} MiB"


class Bytes(Protocol):
    """Anything to read from."""

    def read(self, size: int, /) -> bytes:
        """At most ``size`` bytes, none at the end."""


class Gunzip:
    """What a gzip file holds, member by member; ``truncated`` once it ended early or is broken."""

    def __init__(self, file: Bytes) -> None:
        self.file = file
        self.truncated = False
        self._inflater = zlib.decompressobj(wbits=31)
        self._rest = b""
        self._done = False

    def read(self, size: int, /) -> bytes:
        """At most ``size`` inflated bytes, fewer only at the end."""
        parts: list[bytes] = []
        wanted = size
        while wanted > 0 and not self._done:
            given = self._rest or self.file.read(_PIECE)
            try:
                part = self._inflater.decompress(given, wanted)
            except BAD_DATA:
                self.truncated = self._done = True
                break
            self._rest = self._inflater.unconsumed_tail
            if part:
                parts.append(part)
                wanted -= len(part)
            if self._inflater.eof:
                self._rest = (self._inflater.unused_data or self.file.read(_PIECE)).lstrip(b"\0")
                self._done = not self._rest
                self._inflater = zlib.decompressobj(wbits=31)
            elif not given and not part:
                self.truncated = self._done = True
        return b"".join(parts)


def utf16_of(head: bytes) -> str:
    """Which UTF-16 a text is in, by its byte order mark or, without one, because every other byte
    of its begin is 0 and the rest are ASCII; "" if it is in none."""
    if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    begin = head[:SURE]
    for encoding, zeros, letters in (
        ("utf-16-le", begin[1::2], begin[0::2]),
        ("utf-16-be", begin[0::2], begin[1::2]),
    ):
        if (
            len(begin) == SURE
            and not any(zeros)
            and all(32 <= c < 127 or c in _WHITE for c in letters)
        ):
            return encoding
    return ""


class Transcoded:
    """A text in this ``encoding``, UTF-16, as UTF-8; ``begin`` has been read already."""

    def __init__(self, begin: bytes, file: Bytes, encoding: str) -> None:
        self.file = file
        self._decoder = codecs.getincrementaldecoder(encoding)("replace")
        self._text = self._decoder.decode(begin).encode()
        self._done = False

    def read(self, size: int, /) -> bytes:
        """At most ``size`` bytes of UTF-8, fewer only at the end."""
        parts, wanted = [self._text[:size]], size - len(self._text[:size])
        self._text = self._text[size:]
        while wanted > 0 and not self._done:
            given = self.file.read(_PIECE)
            self._done = not given
            text = self._decoder.decode(given, self._done).encode()
            parts.append(text[:wanted])
            self._text = text[wanted:]
            wanted -= len(parts[-1])
        return b"".join(parts)


class Returns:
    """A text whose lines end in a carriage return, with newlines instead."""

    def __init__(self, file: Bytes) -> None:
        self.file = file

    def read(self, size: int, /) -> bytes:
        """At most ``size`` bytes, fewer only at the end."""
        return self.file.read(size).replace(b"\r", b"\n")


class LogSource:
    """One log file, read from its start to its end; byte order marks are left out, UTF-16 becomes
    UTF-8, and carriage returns newlines in a text that has none.

    ``head`` the first bytes; ``position`` how many inflated bytes have been read; ``rejected`` what
    had to be dropped before a reader saw it: reason → number.
    """

    def __init__(self, path: Path, file: IO[bytes]) -> None:
        self.path = path
        self.rejected: Counter[str] = Counter()
        self.position = 0
        self.zipped = file.read(2) == b"\x1f\x8b"
        file.seek(0)
        self._gunzip = Gunzip(file) if self.zipped else None
        self._file: Bytes = self._gunzip or file
        self.head = self._file.read(HEAD)
        if encoding := utf16_of(self.head):
            self._file = Transcoded(self.head, self._file, encoding)
            self.head = self._file.read(HEAD)
        self.head = self.head.removeprefix(codecs.BOM_UTF8)
        if b"\r" in self.head and b"\n" not in self.head and b"\0" not in self.head:
            self._file, self.head = Returns(self._file), self.head.replace(b"\r", b"\n")
        self._unread = self.head
        if self.truncated and not self.head:
            raise ClutchestError(f"{path}: damaged gzip data")

    @property
    def truncated(self) -> bool:
        """Whether compressed data ended early."""
        return self._gunzip is not None and self._gunzip.truncated

    def read(self, size: int, /) -> bytes:
        """At most ``size`` bytes, fewer only at the end."""
        given = self._unread[:size]
        self._unread = self._unread[size:]
        if len(given) < size:
            given += self._file.read(size - len(given))
        self.position += len(given)
        return given

    def lines(self) -> Iterator[NDArray[np.uint8]]:
        """Blocks of whole lines, each ending in a newline; longer lines are dropped and counted.

        A block is valid until the next one is asked for: all share their memory, because new
        memory costs more time than reading.
        """
        buffer = bytearray(BLOCK + 1)
        text, room = np.frombuffer(buffer, np.uint8), memoryview(buffer)
        held, dropping = 0, False
        while given := self._readinto(room[held:BLOCK]):
            start = buffer.find(b"\n", held, held + given) + 1 if dropping else 0
            held += given
            end = buffer.rfind(b"\n", 0, held) + 1
            if end and (start or not dropping):
                dropping = False
                yield text[start:end]
                text[: held - end] = text[end:held]
                held -= end
            elif dropping or held == BLOCK:
                self.rejected[_LONG_LINE] += not dropping
                dropping, held = True, 0
                yield text[:0]  # a chance to give up
        if held:
            buffer[held] = ord("\n")
            yield text[: held + 1]

    def _readinto(self, room: memoryview) -> int:
        part = self.read(len(room))
        room[: len(part)] = part
        return len(part)

    def everything(self, limit: int) -> bytes:
        """The whole file.  Raises ClutchestError if it holds more than ``limit`` bytes."""
        content = self.read(limit + 1)
        if len(content) > limit:
            raise ClutchestError(
                f"{self.path}: holds more than {limit >> 20} MiB compressed; "
                "this format is read whole, so unpack it first"
            )
        return content


@contextmanager
def opened(path: Path) -> Iterator[LogSource]:
    """The log at ``path``.  Raises ClutchestError if it cannot be read or is empty gzip data."""
    try:
        with path.open("rb") as file:
            yield LogSource(path, file)
    except OSError as error:
        if error.filename is not None and Path(error.filename) != path:
            raise
        raise ClutchestError(f"{path}: cannot be read ({error.strerror or error})") from None


@contextmanager
def quiet(library: str) -> Iterator[None]:
    """Silences the ``library``'s log: what is broken in a file is counted, or an error, here."""
    within = [name for name in logging.root.manager.loggerDict if name.startswith(f"{library}.")]
    loggers = [logging.getLogger(name) for name in (library, *within)]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)
