"""From a log, block by block, the frames that are needed, and an account of those that are not.

So a log may be larger than memory: what is kept are the frames of the wanted messages.  Beside them
a few others stay, by which the whole is known: the first and the last of each block, both sides of
each jump of the clock, and one of each id near the beginning.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from clutchest.can import transport
from clutchest.can.database import Message
from clutchest.can.frames import Flag, Frames

_KNOWN_BY = 4  # blocks in which one frame of each id is kept
_KIND = np.uint8(Flag.EXTENDED | Flag.REMOTE | Flag.ERROR)


@dataclass
class Sieve:
    """What ``messages`` need; clock jumps beyond ``hole_ns`` are kept too."""

    messages: Iterable[Message]
    hole_ns: int
    _blocks: int = 0
    _seen: set[int] = field(default_factory=set)

    def sift(self, frames: Frames) -> Frames:
        """The rows to keep; ``passed_over`` counts the others."""
        if not len(frames):
            return frames
        kind = frames.flags & _KIND
        keep = np.zeros(len(frames), bool)
        for message in self.messages:
            same = (frames.id & np.uint32(message.id_mask)) == (message.id & message.id_mask)
            keep |= same & (kind == (Flag.EXTENDED if message.extended else 0))
        if any(transport.may_carry(message) for message in self.messages):
            keep |= transport.belongs(frames)
        if not keep.all():
            keep[self._marks(frames, kind)] = True
        left, odd = frames.flags[~keep], Flag.ERROR | Flag.REMOTE
        error = int(np.count_nonzero(left & Flag.ERROR))
        remote = int(np.count_nonzero((left & odd) == Flag.REMOTE))
        counts = {
            "error frame": error,
            "remote frame": remote,
            "not mapped": len(left) - error - remote,
        }
        passed_over = tuple((reason, n) for reason, n in counts.items() if n)
        return replace(frames.take(keep) if len(left) else frames, passed_over=passed_over)

    def _marks(self, frames: Frames, kind: NDArray[np.uint8]) -> NDArray[np.intp]:
        t = frames.t_ns
        jumps = np.flatnonzero(np.abs(np.diff(t)) > self.hole_ns)
        ends = np.array([0, len(t) - 1, t.argmin(), t.argmax()])
        marks: list[NDArray[np.intp]] = [ends, jumps, jumps + 1]
        if self._blocks < _KNOWN_BY:
            self._blocks += 1
            extended = (kind & np.uint8(Flag.EXTENDED)).astype(np.int64)
            ids, first = np.unique(frames.id | extended << 32, return_index=True)
            new = [can_id not in self._seen for can_id in ids.tolist()]
            self._seen.update(ids.tolist())
            marks.append(first[new])
        return np.concatenate(marks)
