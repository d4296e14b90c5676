"""Time stamps for the estimates: by the interface's clock, increasing and without jumps."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from clutchest.can.bus import Received
from clutchest.can.frames import Frames

JUMP_NS = 1_000_000_000  # a clock that differs by more from one moment to the next was set
LATE_NS = 5_000_000_000  # frames are late for at most so long once none is waiting any more
TICK_NS = 1000  # stamps are whole µs, no two equal, as in a candump log
ABSOLUTE_NS = 10**18  # September 2001; a clock below counts from its own start
_FORGET = 0.01  # share by which the difference of two clocks follows each batch


class Stamps:
    """Corrects an interface's stamps to one continuous clock.

    A stamp is compared with the monotonic time at which the frame was received.  The difference is
    a latency, small most of the time; a jump of it is one of the interface's clock, and is
    corrected.  ``jumps`` collects these, s, for the caller to clear.
    """

    def __init__(
        self,
        monotonic_ns: Callable[[], int] = time.monotonic_ns,
        clock_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        self._monotonic_ns, self._clock_ns = monotonic_ns, clock_ns
        self._offset: int | None = None  # of the interface's clock, at no latency
        self._late_since: int | None = None
        self._correction = 0
        self._raw, self._last, self._last_at, self._floor = 0, 0, 0, 0
        self.jumps: list[float] = []

    def used(self, received: Received) -> Frames:
        """The frames with increasing stamps, whole µs; in the order of reception."""
        frames = received.frames
        if not len(frames):
            return frames
        raw, at = frames.t_ns, received.at_ns
        steps = np.diff(raw)
        if np.any(np.abs(steps) > JUMP_NS):  # set within the batch: the last stamp counts
            steps = np.where((steps > JUMP_NS) | (steps < 0), TICK_NS, steps)
            raw = raw[-1] - np.concatenate((np.cumsum(steps[::-1])[::-1], [0]))
        self._follow(int(raw[0]), int(raw[-1]), at, received.more)
        t = (raw + self._correction) // TICK_NS
        order = np.arange(len(t))
        least = max(self._last, self._floor) // TICK_NS + 1
        t = np.maximum.accumulate(np.maximum(t, least) - order) + order
        self._raw, self._last, self._last_at = int(raw[-1]), int(t[-1]) * TICK_NS, at
        return replace(frames, t_ns=t * TICK_NS)

    def now(self) -> int:
        """The present on this clock, ns."""
        return self._at(self._monotonic_ns())

    def promised(self, until_ns: int) -> int:
        """``until_ns`` of the monotonic clock on this one; frames received afterwards get later
        stamps."""
        self._floor = self._at(until_ns)
        return self._floor

    def _at(self, monotonic_ns: int) -> int:
        return max(self._last, self._floor, self._last + monotonic_ns - self._last_at)

    def _follow(self, first: int, last: int, at: int, more: bool) -> None:
        """Distinguish a clock that was set from frames that are late, as those are that waited in
        the socket while the process was stopped, and those behind them (``more``)."""
        if self._offset is None:
            self._offset = last - at
            if last < ABSOLUTE_NS:
                self._correction = self._clock_ns() - last
            return
        off = last - at - self._offset
        if off > -JUMP_NS or more:
            self._late_since = None
        elif self._late_since is None:
            self._late_since = at
        back = first < self._raw - JUMP_NS
        for_long = self._late_since is not None and at - self._late_since > LATE_NS
        if off > JUMP_NS or back or for_long:
            self.jumps.append(off / 1e9)
            self._offset += off
            self._correction -= off
            self._late_since = None
        elif off > 0:
            self._offset += off
        elif off > -JUMP_NS:
            self._offset += round(_FORGET * off)
