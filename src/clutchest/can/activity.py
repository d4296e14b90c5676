"""When a channel was active: the times of its frames, thinned."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from clutchest.can.frames import Flag, Frames
from clutchest.native import compiled

RESOLUTION_NS = 20_000_000  # of frames that lie closer together, one is enough
_CHANNELS = 256
_NEVER = int(np.iinfo(np.int64).min)
_ERROR = int(Flag.ERROR)


def rows(frames: Frames) -> NDArray[np.intp]:
    """Of each channel a row in every ``RESOLUTION_NS``, the first one; error frames do not count.

    So a pause is known to begin at most that much too early, and its end exactly.
    """
    return _first_of_each(frames.t_ns, frames.channel, frames.flags, RESOLUTION_NS)


def times(frames: Frames, start_ns: int) -> dict[int, NDArray[np.float64]]:
    """Channel → the times of these rows, s since ``start_ns``."""
    chosen = rows(frames)
    channel, time = frames.channel[chosen], (frames.t_ns[chosen] - start_ns) / 1e9
    return {int(c): time[channel == c] for c in np.unique(channel)}


@compiled
def _first_of_each(t_ns, channel, flags, resolution):  # type: ignore[no-untyped-def]
    last = np.full(_CHANNELS, _NEVER)
    chosen = np.empty(len(t_ns), np.intp)
    n = 0
    for i in range(len(t_ns)):
        span = t_ns[i] // resolution
        if span != last[channel[i]] and not flags[i] & _ERROR:
            last[channel[i]] = span
            chosen[n] = i
            n += 1
    return chosen[:n].copy()
