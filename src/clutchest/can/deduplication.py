"""Frames that are told twice, by two files or by one: what is heard twice is no second reading."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numba import njit

from clutchest.can.frames import Frames

_LOOK_BACK = 256  # frames of one time stamp among which a copy is looked for


def without_copies(frames: Frames) -> Frames:
    """``frames`` (sorted) without those that equal one before, stamp included; they are counted in
    ``passed_over``."""
    copies = _copies(
        frames.t_ns, frames.channel, frames.id, frames.flags, frames.length, frames.data
    )
    count = int(np.count_nonzero(copies))
    if not count:
        return frames
    return replace(frames.take(~copies), passed_over=(*frames.passed_over, ("copy", count)))


@njit(cache=True, error_model="numpy")
def _copies(t_ns, channel, ids, flags, length, data):  # type: ignore[no-untyped-def]
    found = np.zeros(len(t_ns), np.bool_)
    for i in range(len(t_ns)):
        first = max(i - _LOOK_BACK, 0)
        k = i - 1
        while k >= first and t_ns[k] == t_ns[i] and not found[i]:
            if ids[k] == ids[i] and channel[k] == channel[i] and flags[k] == flags[i]:
                same = length[k] == length[i]
                for byte in range(data.shape[1]):
                    same = same and data[k, byte] == data[i, byte]
                found[i] = same
            k -= 1
    return found
