"""Sending a log onto a bus at its own pace."""

from __future__ import annotations

import errno
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from clutchest.can import files
from clutchest.can.bus import message_of
from clutchest.can.frames import Flag, Frames
from clutchest.errors import ClutchestError

if TYPE_CHECKING:
    import can

FULL = 5.0  # s that a sender waits for room in the interface's queue


@dataclass
class Played:
    """What became of a log: ``sent`` frames, ``skipped`` error frames, and by how much at most a
    frame left ``late``, s."""

    sent: int = 0
    skipped: int = 0
    late: float = 0.0


def play(
    path: Path,
    bus: can.BusABC,
    *,
    speed: float = 1.0,
    progress: Callable[[Played, float], None] = lambda played, at: None,
) -> Played:
    """Send the frames of a log, ``speed`` times as fast as they were recorded.

    Every frame has its own deadline from the start, so that lateness does not add up; a clock
    that goes back in the log delays nothing.  ``progress`` is called about once a second with what
    was sent and the time in the log, s.  Raises ClutchestError where the bus refuses a frame for
    long.
    """
    import can

    played, start, begun, asked = Played(), time.monotonic(), None, 0.0
    for frames in files.read_blocks(path):
        if begun is None and len(frames):
            begun = int(frames.t_ns[0])
        for row, message in _messages(frames):
            if message is None:
                played.skipped += 1
                continue
            assert begun is not None
            at = (int(frames.t_ns[row]) - begun) / 1e9
            due = start + at / speed
            played.late = max(played.late, _wait(due))
            try:
                _send(bus, message)
            except (can.CanError, OSError) as problem:
                raise ClutchestError(
                    f"{path}: frame {played.sent + played.skipped + 1}: the bus "
                    f"does not take it: {problem}"
                ) from None
            played.sent += 1
            if due - asked > 1.0:
                asked = due
                progress(played, at)
    return played


def _messages(frames: Frames) -> Iterator[tuple[int, can.Message | None]]:
    error = (frames.flags & Flag.ERROR) != 0
    for row in range(len(frames)):
        yield row, None if error[row] else message_of(frames, row)


def _wait(due: float) -> float:
    """Sleep until ``due``, s on the monotonic clock; by how much it was missed."""
    while (left := due - time.monotonic()) > 0:
        time.sleep(left)
    return -left


def _send(bus: can.BusABC, message: can.Message) -> None:
    """Send, waiting while the interface's queue is full."""
    import can

    patience = time.monotonic() + FULL
    while True:
        try:
            return bus.send(message, timeout=FULL)
        except (can.CanError, OSError) as problem:
            codes = (getattr(problem, "error_code", None), getattr(problem, "errno", None))
            if errno.ENOBUFS not in codes or time.monotonic() > patience:
                raise
            time.sleep(0.001)  # the queue drains frame by frame
