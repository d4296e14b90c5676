"""The stamps that the estimates use: of the interface's clock, but never back and never a jump."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from clutchest.can.frames import Frames

JUMP_NS = 1_000_000_000  # a clock that differs by more from one moment to the next was set
TICK_NS = 1000  # stamps are whole µs, no two alike: as a candump log keeps them
ABSOLUTE_NS = 10**18  # September 2001; a clock that shows less counts from its own start
_FORGET = 0.05  # share by which the offset of two clocks follows each batch


class Stamps:
    """Makes one clock of an interface's stamps.

    A stamp is compared with the time at which the frame was handed over, on a clock that nobody
    sets.  The difference is a latency and changes slowly; a jump of it is one of the interface's
    clock, and is taken out.  ``jumps`` holds each, s, until it is asked for.
    """

    def __init__(
        self,
        monotonic_ns: Callable[[], int] = time.monotonic_ns,
        clock_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        self._monotonic_ns, self._clock_ns = monotonic_ns, clock_ns
        self._offset: int | None = None
        self._correction = 0
        self._last, self._last_at = 0, 0
        self.jumps: list[float] = []

    def used(self, frames: Frames) -> Frames:
        """The frames with stamps that rise, whole µs; in the order in which they came."""
        if not len(frames):
            return frames
        now = self._monotonic_ns()
        raw = frames.t_ns
        # what was handed over last has waited least
        if self._offset is None:
            self._offset = int(raw[-1]) - now
            if raw[-1] < ABSOLUTE_NS:
                self._correction = self._clock_ns() - int(raw[-1])
        elif abs(off := int(raw[-1]) - now - self._offset) > JUMP_NS:
            self.jumps.append(off / 1e9)
            self._offset += off
            self._correction -= off
        else:
            self._offset += round(_FORGET * off)
        steps = np.diff(raw)
        if np.any(np.abs(steps) > JUMP_NS):  # the clock was set within the batch
            steps = np.where(np.abs(steps) > JUMP_NS, TICK_NS, steps)
            raw = raw[-1] - np.concatenate((np.cumsum(steps[::-1])[::-1], [0]))
        t = (raw + self._correction) // TICK_NS
        order = np.arange(len(t))
        t = np.maximum.accumulate(np.maximum(t, self._last // TICK_NS + 1) - order) + order
        self._last, self._last_at = int(t[-1]) * TICK_NS, now
        return replace(frames, t_ns=t * TICK_NS)

    def now(self, lag_ns: int) -> int:
        """The present on this clock, less ``lag_ns`` for what may be on its way; ns."""
        return max(self._last, self._last + self._monotonic_ns() - self._last_at - lag_ns)
