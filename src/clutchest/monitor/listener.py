"""A thread that only receives, so that no frame waits for an estimate."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

from clutchest.can.bus import BusReader, Received, message_of
from clutchest.can.frames import Frames
from clutchest.can.readers import reader_of

if TYPE_CHECKING:
    import can

WAIT = 0.1  # s after which the thread checks whether to stop
QUIET_NS = 200_000_000  # without a frame, after which that is said
RETRY = 0.5  # s between two attempts to open an interface that is down
_DOWN = 100  # ENETDOWN: the socket remains usable once the interface is up again


@dataclass(frozen=True, slots=True)
class Trouble:
    """The interface failed with the error ``what``; or it is ``back``."""

    what: str
    back: bool = False


@dataclass(frozen=True, slots=True)
class Quiet:
    """Every frame that came before ``until_ns``, on the monotonic clock, has been handed over."""

    until_ns: int


class Listener(threading.Thread):
    """Puts frames from a bus into the queue ``received``, when the interface fails and returns,
    and up to when it has listened in vain.

    ``dropped`` frames were lost so far because a socket's buffer was full; these are all, where
    ``losses_known``: not where the interface does not tell, or was away.  ``reopen`` opens a new
    bus when the old one is unusable; without it the old one is tried again.
    """

    def __init__(self, bus: can.BusABC, reopen: Callable[[], can.BusABC] | None) -> None:
        super().__init__(daemon=True, name="listener")
        self.received: queue.SimpleQueue[Received | Trouble | Quiet] = queue.SimpleQueue()
        self._reader: BusReader = reader_of(bus)
        self._reopen = reopen
        self._done = threading.Event()
        self.losses_known = self._reader.dropped is not None
        self._down, self._told_ns = False, 0
        self._earlier = 0  # frames that the buses before this one have dropped
        self.died = ""  # of what, where it did

    def run(self) -> None:
        """Receive until stopped."""
        try:
            self._receive()
        except BaseException as problem:  # a thread that dies must end the session, not go deaf
            self.died = f"{type(problem).__name__}: {' '.join(str(problem).split())}"

    @property
    def dead(self) -> bool:
        """Whether nothing is received any more, though nobody stopped it."""
        return not self._done.is_set() and not self.is_alive()

    @property
    def dropped(self) -> int:
        """See the class."""
        return self._earlier + (self._reader.dropped or 0)

    def _receive(self) -> None:
        import can

        while not self._done.is_set():
            begun = time.monotonic_ns()
            try:
                received = self._reader.read(WAIT)
            except (can.CanError, OSError, ValueError) as problem:
                self._trouble(problem)
                self._quiet(begun)
                continue
            if received is None:
                self._quiet(begun)
                continue
            if self._down:
                self._down = False
                self.received.put(Trouble("", back=True))
            self._told_ns = received.at_ns
            self.received.put(received)

    def _quiet(self, until_ns: int) -> None:
        """Nothing came after ``until_ns``: what came before has been put into the queue.

        Not the clock of whoever takes it says so: a process that was stopped finds the frames of
        that time still in the socket.
        """
        if until_ns - self._told_ns >= QUIET_NS:
            self._told_ns = until_ns
            self._reader.count()
            self.received.put(Quiet(until_ns))

    def send(self, frames: Frames) -> None:
        """Put frames on the bus, unless it is down."""
        import can

        with suppress(can.CanError, OSError, ValueError):
            for row in range(len(frames)):
                self._reader.bus.send(message_of(frames, row), timeout=0.0)

    def stop(self) -> None:
        """Stop, and close the bus."""
        self._done.set()
        self.join(timeout=5 * WAIT)
        self._reader.count()
        self._reader.bus.shutdown()

    def _trouble(self, problem: Exception) -> None:
        if not self._down:
            self._down, self.losses_known = True, False
            self.received.put(Trouble(" ".join(str(problem).split()) or type(problem).__name__))
        code = getattr(problem, "errno", None) or getattr(problem, "error_code", None)
        self._done.wait(RETRY)
        if code == _DOWN or self._reopen is None or self._done.is_set():
            return
        import can
        from clutchest.errors import ClutchestError

        try:
            bus = self._reopen()
        except (ClutchestError, can.CanError, OSError):
            return
        self._reader.count()
        self._earlier = self.dropped
        self._reader.bus.shutdown()
        self._reader = reader_of(bus)
