"""Deduplication: a frame recorded twice, in two files or in one, is one reading."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from clutchest.can.frames import Frames
from clutchest.native import compiled

_LOOK_BACK = 256  # frames of one time stamp among which a duplicate is searched


def without_duplicates(frames: Frames) -> Frames:
    """``frames`` (sorted) without those that equal one before, stamp included; they are counted in
    ``passed_over``."""
    duplicate = _duplicates(
        frames.t_ns, frames.channel, frames.id, frames.flags, frames.length, frames.data
    )
    count = int(np.count_nonzero(duplicate))
    if not count:
        return frames
    return replace(frames.take(~duplicate), passed_over=(*frames.passed_over, ("duplicate", count)))


@compiled
def _duplicates(t_ns, channel, ids, flags, length, data):  # type: ignore[no-untyped-def]
    duplicate = np.zeros(len(t_ns), np.bool_)
    for i in range(len(t_ns)):
        first = max(i - _LOOK_BACK, 0)
        k = i - 1
        while k >= first and t_ns[k] == t_ns[i] and not duplicate[i]:
            if ids[k] == ids[i] and channel[k] == channel[i] and flags[k] == flags[i]:
                same = length[k] == length[i]
                for byte in range(data.shape[1]):
                    same = same and data[k, byte] == data[i, byte]
                duplicate[i] = same
            k -= 1
    return duplicate
