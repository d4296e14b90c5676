"""From a log, block by block, the frames that are needed, and the number of all others by reason.

So a log may be larger than memory: the frames of the mapped messages are kept, and a few others
that describe the whole: the first and the last of each block, both sides of each jump of the
clock, one of each id near the beginning, and as many as tell when each channel was active.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from clutchest.can import activity, transport
from clutchest.can.database import Message
from clutchest.can.frames import Flag, Frames

_ID_BLOCKS = 4  # blocks in which one frame of each id is kept
_KIND = np.uint8(Flag.EXTENDED | Flag.REMOTE | Flag.ERROR)


@dataclass
class FrameFilter:
    """Keeps the frames of ``messages``, and both sides of clock jumps beyond ``gap_ns``; ``found``
    once there was one of them."""

    messages: Iterable[Message]
    gap_ns: int
    found: bool = False
    _blocks: int = 0
    _seen: set[int] = field(default_factory=set)

    def kept(self, frames: Frames) -> Frames:
        """The rows to keep; ``passed_over`` counts the others."""
        if not len(frames):
            return frames
        kind = frames.flags & _KIND
        keep = np.zeros(len(frames), bool)
        for message in self.messages:
            same = (frames.id & np.uint32(message.id_mask)) == (message.id & message.id_mask)
            same &= kind == (Flag.EXTENDED if message.extended else 0)
            if message.channel is not None:
                same &= frames.channel == message.channel
            keep |= same
        if any(transport.may_carry(message) for message in self.messages):
            keep |= transport.belongs(frames)
        self.found = self.found or bool(keep.any())
        if not keep.all():
            keep[self._landmarks(frames, kind)] = True
        left, special = frames.flags[~keep], Flag.ERROR | Flag.REMOTE
        error = int(np.count_nonzero(left & Flag.ERROR))
        remote = int(np.count_nonzero((left & special) == Flag.REMOTE))
        counts = {
            "error frame": error,
            "remote frame": remote,
            "not mapped": len(left) - error - remote,
        }
        passed_over = tuple((reason, n) for reason, n in counts.items() if n)
        return replace(frames.take(keep) if len(left) else frames, passed_over=passed_over)

    def _landmarks(self, frames: Frames, kind: NDArray[np.uint8]) -> NDArray[np.intp]:
        t = frames.t_ns
        jumps = np.flatnonzero(np.abs(np.diff(t)) > self.gap_ns)
        ends = np.array([0, len(t) - 1, t.argmin(), t.argmax()])
        landmarks: list[NDArray[np.intp]] = [ends, jumps, jumps + 1, activity.rows(frames)]
        if self._blocks < _ID_BLOCKS:
            self._blocks += 1
            extended = (kind & np.uint8(Flag.EXTENDED)).astype(np.int64)
            ids, first = np.unique(frames.id | extended << 32, return_index=True)
            new = [can_id not in self._seen for can_id in ids.tolist()]
            self._seen.update(ids.tolist())
            landmarks.append(first[new])
        return np.concatenate(landmarks)
