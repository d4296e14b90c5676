"""The columns of one message, decoded without more memory than a portion of its frames takes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from clutchest import memory_mapped
from clutchest.can.database import Message
from clutchest.can.decode import DecodedColumn, decode
from clutchest.can.frames import Frames
from clutchest.signals import Why

_NO_RAW = np.zeros(0, np.uint64)


def column_of(
    frames: Frames, rows: NDArray[np.intp], message: Message, signal: str
) -> DecodedColumn:
    """One ``signal`` of the frames at ``rows`` (n,), which are all of ``message``; its ``raw`` is
    empty, because decoding has judged it already."""
    pieces: list[tuple[NDArray, ...]] = []
    for part in memory_mapped.portions(max(len(rows), 1)):
        some = rows if len(rows) <= memory_mapped.PORTION else rows[part]
        column = decode(frames, some, message, [signal])[signal]
        if some is rows:
            return replace(column, raw=_NO_RAW)
        piece: tuple[NDArray, ...] = (column.rows, column.value, column.why)
        pieces.append(tuple(map(memory_mapped.mapped_to_disk, piece)))
    with_signal, value, why = (
        memory_mapped.concatenated(column) for column in zip(*pieces, strict=True)
    )
    return DecodedColumn(
        rows if len(with_signal) == len(rows) else with_signal, value, _NO_RAW, why
    )


def without_corrupted(
    column: DecodedColumn, rows: NDArray[np.intp], corrupted: NDArray[np.bool_]
) -> DecodedColumn:
    """The ``column`` with the samples of ``corrupted`` frames (n,), at ``rows`` (n,), invalid."""
    n = len(column.rows)
    value, why = memory_mapped.empty((n,), np.float64), memory_mapped.empty((n,), np.uint8)
    for part in memory_mapped.portions(n):
        place = part if column.rows is rows else np.searchsorted(rows, column.rows[part])
        bad = corrupted[place] & (column.why[part] == Why.VALID)
        why[part] = np.where(bad, np.uint8(Why.CHECKSUM), column.why[part])
        value[part] = np.where(why[part] == Why.VALID, column.value[part], np.nan)
    return replace(column, value=value, why=why)
