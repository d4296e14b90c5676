"""Memory-mapped arrays: those as long as a log, in files beyond the first 128 MiB.

Such an array is used like any other.  :func:`release_memory` frees the memory of all of them;
values are then read from the file when needed.  Where the system cannot reserve disk space, which
only POSIX guarantees, or has none left, arrays stay in memory.
"""

from __future__ import annotations

import mmap
import os
from collections.abc import Sequence
from contextlib import suppress
from tempfile import TemporaryFile
from threading import Lock
from weakref import WeakSet, finalize

import numpy as np
from numpy.typing import DTypeLike, NDArray

from clutchest.cache import cache_folder

LEAST = 1 << 18  # bytes; smaller arrays stay in memory
HELD = 128 << 20  # bytes of larger ones that stay there too: an hour needs no files
SEGMENT = 64 << 20  # bytes of one file
PORTION = 1 << 17  # rows that are processed together


class _Map(mmap.mmap):
    """A file in memory that weak references can name."""


_maps: WeakSet[_Map] = WeakSet()
_lock = Lock()  # of these: a drive is filtered by two threads
_held: dict[int, int] = {}  # bytes of large arrays in memory, by their identity
_room: list[tuple[NDArray[np.uint8], int]] = []  # the last segment, and how much of it is taken


def empty(shape: Sequence[int], dtype: DTypeLike) -> NDArray:
    """An array of ``shape`` with anything in it, in a file if it is large."""
    kind, shape = np.dtype(dtype), tuple(shape)
    size = int(np.prod(shape)) * kind.itemsize
    place = None if size < LEAST or _fits(size) else _place(size)
    if place is None:
        return _counted(np.empty(shape, kind))
    return place[:size].view(kind).reshape(shape)


def mapped_to_disk(values: NDArray) -> NDArray:
    """The same ``values``, in a file if they are many."""
    if values.nbytes < LEAST or id(values) in _held:
        return values
    return _counted(values) if _fits(values.nbytes) else concatenated([values])


def concatenated(parts: Sequence[NDArray]) -> NDArray:
    """All ``parts``, at least one, one behind another."""
    rows, kind = sum(len(part) for part in parts), np.result_type(*parts)
    whole, n = empty((rows, *parts[0].shape[1:]), kind), 0
    for part in parts:
        for rows_of in portions(len(part)):
            piece = part[rows_of]
            whole[n : n + len(piece)] = piece
            n += len(piece)
            if whole.nbytes >= LEAST:
                release_memory()
    return whole


def portions(n: int) -> list[slice]:
    """``n`` rows in pieces."""
    return [slice(first, min(first + PORTION, n)) for first in range(0, n, PORTION)]


def release_memory() -> None:
    """Free the memory of all mapped files."""
    with _lock:
        maps = list(_maps)
    for mapped in maps:
        mapped.madvise(mmap.MADV_DONTNEED)


def _fits(size: int) -> bool:
    """Whether an array of ``size`` bytes may stay in memory."""
    return sum(_held.values()) + size <= HELD


def _counted(values: NDArray) -> NDArray:
    """``values``, which count as held in memory until nothing refers to them."""
    if values.nbytes >= LEAST:
        _held[id(values)] = values.nbytes
        finalize(values, _held.pop, id(values), None)
    return values


def _place(size: int) -> NDArray[np.uint8] | None:
    """Room for ``size`` bytes in a file; None where there is none."""
    size = -(-size // mmap.PAGESIZE) * mmap.PAGESIZE
    if not _room or _room[0][1] + size > len(_room[0][0]):
        segment = _segment(max(size, SEGMENT))
        if segment is None:
            return None
        _room[:] = [(segment, 0)]
    segment, taken = _room[0]
    _room[0] = (segment, taken + size)
    return segment[taken : taken + size]


def _segment(size: int) -> NDArray[np.uint8] | None:
    if not hasattr(os, "posix_fallocate") or not hasattr(mmap, "MADV_DONTNEED"):
        return None
    with suppress(OSError, ValueError):
        folder = cache_folder()  # not where temporary files lie: that may be memory itself
        folder.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=folder) as file:
            os.posix_fallocate(file.fileno(), 0, size)  # so that a full disk is an error here
            mapped = _Map(file.fileno(), size)
        with _lock:
            _maps.add(mapped)
        return np.frombuffer(mapped, np.uint8)
    return None
