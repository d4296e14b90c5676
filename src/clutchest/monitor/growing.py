"""Files of a live session that grow: what was written is kept whatever becomes of the process."""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from clutchest.errors import ClutchestError


class GrowingFile:
    """A new file that is appended to, piece by piece, each on its way to the disk at once."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file = path.open("wb+", buffering=0)
        self._whole = 0  # bytes of complete pieces

    def write(self, piece: bytes) -> None:
        """Append the whole piece, or nothing.  Raises ClutchestError where the disk refuses."""
        rest = memoryview(piece)
        try:
            while rest:
                rest = rest[self._file.write(rest) :]
        except OSError as problem:
            with suppress(OSError):
                self.cut(self._whole)
            raise ClutchestError(
                f"{self.path}: {problem.strerror}; what was written before is kept, and the next "
                "session in this folder completes its files"
            ) from None
        self._whole += len(piece)

    def cut(self, size: int) -> None:
        """Remove all behind ``size`` bytes."""
        self._file.truncate(size)
        self._file.seek(size)
        self._whole = size

    def close(self) -> None:
        """Close the file; what was written is in it already."""
        self._file.close()


def cut_last_line(path: Path) -> None:
    """Remove a last line that a killed process has not finished."""
    with suppress(FileNotFoundError), path.open("rb+") as file:
        end = size = file.seek(0, 2)
        while end:
            start = max(end - (1 << 16), 0)
            file.seek(start)
            at = file.read(end - start).rfind(b"\n")
            if at >= 0:
                end = start + at + 1
                break
            end = start
        if end < size:
            file.truncate(end)


def layout_of(columns: Mapping[str, Any]) -> np.dtype:
    """The row of a growing table."""
    kinds = {"mode": np.uint8, "drive": np.int32}
    return np.dtype(
        [(name, kinds.get(name, np.asarray(column).dtype)) for name, column in columns.items()]
    )


def head_line(layout: np.dtype, about: Mapping[str, Any]) -> bytes:
    """The first line of a growing table, which :func:`read_growing` reads."""
    return json.dumps({"columns": layout.descr, **about}).encode() + b"\n"


def read_growing(path: Path) -> tuple[dict[str, Any], int, np.ndarray]:
    """The head of a growing table, the offset of its first row, and its complete rows
    (memory-mapped); an empty head and no rows where it was cut off within its first line."""
    with path.open("rb") as file:
        line = file.readline()
    if not line.endswith(b"\n"):
        return {}, 0, np.zeros(0)
    head = json.loads(line)
    layout = np.dtype([(name, kind) for name, kind in head["columns"]])
    count = (path.stat().st_size - len(line)) // layout.itemsize
    if not count:
        return head, len(line), np.zeros(0, layout)
    return head, len(line), np.memmap(path, layout, "r", len(line), (count,))
