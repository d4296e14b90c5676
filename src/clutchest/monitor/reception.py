"""Reception: frames from the bus with the stamps that the estimates use, and what goes wrong."""

from __future__ import annotations

import queue
import time
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from clutchest.can.bus import Received, filters
from clutchest.can.database import Message
from clutchest.can.encode import check
from clutchest.can.frames import Frames
from clutchest.errors import ClutchestError
from clutchest.monitor.listener import Listener, Quiet, Trouble
from clutchest.monitor.stamps import Stamps

if TYPE_CHECKING:
    import can

GATHER_S = 0.05  # s for which frames are gathered, as long as no estimate is due
PROMPT_S = 0.008  # s before one is due, from which every frame is taken at once
TRANSIT_NS = 1_000_000_000  # a frame may take this long from its stamp to here

MOST = 20_000  # frames in one go, and the batch with which it is reached

Report = Callable[[str, str, Mapping[str, Any]], None]  # (kind of event, name, data)


class Reception:
    """Frames of ``messages`` from ``bus``; failures and losses go to ``report`` as events.

    ``count`` frames received, ``lost`` frames dropped by the socket (all, where ``losses_known``),
    ``malformed`` what was no frame, by kind; ``away`` the error while the interface is down.
    """

    def __init__(
        self,
        bus: can.BusABC,
        messages: Sequence[Message],
        reopen: Callable[[], can.BusABC] | None,
        report: Report,
    ) -> None:
        bus.set_filters(filters(messages))  # type: ignore[arg-type]
        self.count = self.lost = self._heard_ns = 0
        self.malformed: dict[str, int] = {}
        self.away = ""
        self._stamps, self._report = Stamps(), report
        self._listener = Listener(bus, reopen)
        self._listener.start()

    @property
    def losses_known(self) -> bool:
        """Whether ``lost`` are all frames that were lost."""
        return self._listener.losses_known

    def send(self, frames: Frames) -> None:
        """Put frames on the bus; while the interface is down they are lost."""
        self._listener.send(frames)

    def stop(self) -> None:
        """Stop listening and close the bus; frames received before can still be taken."""
        self._listener.stop()

    def take(self, wait: float, due_ns: int | None) -> Frames:
        """The frames received meanwhile, after ``wait`` s at most if there are none; ``due_ns``,
        on their clock, when the next estimate may become final."""
        batches, received = [], self._listener.received
        try:
            item = received.get(timeout=wait) if wait else received.get_nowait()
            if wait:
                self._gather(due_ns)
            while True:
                if isinstance(item, Trouble):
                    self._trouble(item)
                elif isinstance(item, Quiet):
                    self._heard_ns = item.until_ns
                else:
                    batches.append(self._stamped(item))
                if sum(map(len, batches)) >= MOST:  # what comes faster waits for the next call
                    break
                item = received.get_nowait()
        except queue.Empty:
            pass
        self._lost()
        if not batches and self._listener.dead:
            raise ClutchestError(
                "the thread that receives frames has ended"
                + (f" ({self._listener.died})" if self._listener.died else "")
            )
        return Frames.concatenate(batches)

    def horizon_ns(self) -> int:
        """The time, on the frames' clock, up to which all frames have been received."""
        return self._stamps.promised(self._heard_ns - TRANSIT_NS)

    def _gather(self, due_ns: int | None) -> None:
        """Let frames accumulate while nothing is due: one batch costs as much as one frame."""
        left = GATHER_S if due_ns is None else (due_ns - self._stamps.now()) / 1e9 - PROMPT_S
        if left > 0:
            time.sleep(min(left, GATHER_S))

    def _stamped(self, received: Received) -> Frames:
        frames = self._stamps.used(received)
        self.count += len(frames)
        for jump in self._stamps.jumps:
            words = f"the interface's clock jumped by {jump:+.1f} s; the stamps are corrected"
            self._report("warning", words, {"jump_s": jump})
        self._stamps.jumps.clear()
        self._malformed(received)
        return frames

    def _lost(self) -> None:
        if (more := self._listener.dropped - self.lost) > 0:
            self.lost += more
            data = {"frames_dropped": more, "why": "the socket's buffer was full"}
            self._report("gap", "bus", data)

    def _malformed(self, received: Received) -> None:
        """Tell of datagrams that are no frames, each kind when it first comes."""
        for kind, count in received.malformed.items():
            if kind not in self.malformed:
                self._report("warning", f"dropped, as it is no frame: {kind}", {"count": count})
            self.malformed[kind] = count

    def _trouble(self, trouble: Trouble) -> None:
        if trouble.back:
            self._report("reconnect", "bus", {"after": self.away})
            self.away = ""
        else:
            self.away = trouble.what
            self._report("warning", f"the interface failed: {trouble.what}", {})


class CounterCheck:
    """Counts frames of messages with a checked counter that were sent and not received."""

    def __init__(self, messages: Sequence[Message]) -> None:
        self._messages = tuple(messages)
        self._last: dict[str, Frames] = {}

    def jumps(self, frames: Frames) -> dict[str, int]:
        """Message → jumps of its counter within new frames, of those that have any."""
        counts = {}
        for message in self._messages:
            rows = np.flatnonzero(
                (frames.id & np.uint32(message.id_mask)) == (message.id & message.id_mask)
            )
            if not len(rows):
                continue
            new = frames.take(rows)
            before = self._last.get(message.name)
            both = new if before is None else Frames.concatenate([before, new])
            self._last[message.name] = new.take(np.array([-1]))
            if jumps := check(both, np.arange(len(both)), message).jumps:
                counts[message.name] = jumps
        return counts
