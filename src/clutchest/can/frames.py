"""Frames: a CAN log as columns."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, fields
from enum import IntFlag
from importlib import import_module
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clutchest import memory_mapped
from clutchest.checked import checked
from clutchest.shown import Comparable


class Flag(IntFlag):
    """Bits of ``Frames.flags``."""

    EXTENDED = 1
    REMOTE = 2
    ERROR = 4
    FD = 8
    BITRATE_SWITCH = 16
    ERROR_STATE = 32
    SENT = 64  # transmitted by the logger itself


# Payload bytes by length code (DLC), of CAN FD beyond 8, and the code by payload bytes.
LENGTHS = np.array([0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64], np.int64)
LENGTH_CODE = np.zeros(65, np.uint8)
LENGTH_CODE[LENGTHS] = np.arange(16)

Tally = tuple[tuple[str, int], ...]  # (reason, number)


@dataclass(frozen=True, slots=True, eq=False)
class Frames(Comparable):
    """One row per frame, in the order of the file.

    ``t_ns`` int64 (n,): ns since the epoch, or since the log's start where ``absolute`` is False;
    ``channel`` uint8 (n,); ``id`` uint32 (n,) without flag bits; ``flags`` uint8 (n,), see
    :class:`Flag`; ``length`` uint8 (n,) payload bytes; ``data`` uint8 (n, 8) or (n, 64), zero
    behind the payload.  Messages put together from several frames may be longer: ``length`` is then
    uint16 and ``data`` as wide as the longest.
    """

    t_ns: NDArray[np.int64]
    channel: NDArray[np.uint8]
    id: NDArray[np.uint32]
    flags: NDArray[np.uint8]
    length: NDArray[np.unsignedinteger]
    data: NDArray[np.uint8]
    absolute: bool = True
    rejected: Tally = ()  # lines or objects of the file that were not read
    passed_over: Tally = ()  # frames that were read, but not kept
    notes: tuple[str, ...] = ()  # what the file leaves open, for a warning

    @classmethod
    def empty(
        cls,
        n: int = 0,
        width: int = 8,
        absolute: bool = True,
        rejected: Tally = (),
        notes: tuple[str, ...] = (),
    ) -> Frames:
        """``n`` rows of zeros."""
        return cls(
            np.zeros(n, np.int64),
            np.zeros(n, np.uint8),
            np.zeros(n, np.uint32),
            np.zeros(n, np.uint8),
            np.zeros(n, np.uint8),
            np.zeros((n, width), np.uint8),
            absolute,
            rejected,
            notes=notes,
        )

    def __len__(self) -> int:
        return len(self.t_ns)

    def take(self, rows: NDArray | slice) -> Frames:
        """The given rows (indices, a mask, or from … to)."""
        return Frames(
            self.t_ns[rows],
            self.channel[rows],
            self.id[rows],
            self.flags[rows],
            self.length[rows],
            self.data[rows],
            self.absolute,
            self.rejected,
            self.passed_over,
            self.notes,
        )

    @checked
    def decode(self, database: Any, messages: Sequence[str] | None = None) -> Any:
        """The signals of all ``messages`` (every one unless given) of a ``database``: a DBC or
        another file, several, those of each channel (``{0: "a.dbc", 1: "b.dbc"}``), or one that is
        loaded.  Gives :class:`clutchest.can.DecodedFrames`.
        """
        decoded = import_module("clutchest.can.decoded")  # which is made of frames
        return decoded.DecodedFrames.of(self, database, messages)

    def __repr__(self) -> str:
        return f"<Frames: {len(self)} of {len(np.unique(self.id))} ids>"

    def steps(self) -> Iterator[tuple[int, NDArray[np.int64]]]:
        """From each frame to the next, ns, a portion at a time, each with its first row."""
        for rows in memory_mapped.portions(len(self) - 1):
            yield rows.start, np.diff(self.t_ns[rows.start : rows.stop + 1])

    def sorted(self) -> Frames:
        """Rows in order of time; frames of equal time keep their order."""
        if all(np.all(step >= 0) for _, step in self.steps()):
            return self
        return self.take(np.argsort(self.t_ns, kind="stable"))

    @classmethod
    def concatenate(cls, parts: Iterable[Frames]) -> Frames:
        """All rows of ``parts``, one after the other; a narrow payload is padded with zeros.

        Column by column, so that the memory of parts not referred to elsewhere is freed early.
        """
        given: dict[str, list] = {f.name: [] for f in fields(cls)}
        for part in parts:
            for name, values in given.items():
                values.append(getattr(part, name))
        if not given["t_ns"]:
            return cls.empty()
        width = max(data.shape[1] for data in given["data"])
        given["data"] = [
            data if data.shape[1] == width else np.pad(data, ((0, 0), (0, width - data.shape[1])))
            for data in given["data"]
        ]
        whole: dict[str, Any] = {
            "absolute": all(given.pop("absolute")),
            "rejected": added_up(given.pop("rejected")),
            "passed_over": added_up(given.pop("passed_over")),
            "notes": tuple(dict.fromkeys(chain.from_iterable(given.pop("notes")))),
        }
        for name in list(given):
            columns = given.pop(name)
            whole[name] = columns[0] if len(columns) == 1 else memory_mapped.concatenated(columns)
        return cls(**whole)


def added_up(tallies: Iterable[Tally]) -> Tally:
    """One number per reason."""
    total: Counter[str] = Counter()
    for tally in tallies:
        total.update(dict(tally))
    return tuple(total.items())
