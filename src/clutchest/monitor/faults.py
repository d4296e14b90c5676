"""Fault tests of a live session, and active trouble codes on the bus."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict
from pathlib import Path

import numpy as np

from clutchest.can.database import Database
from clutchest.can.dm1 import EVERY_S, Code, frames_of
from clutchest.can.frames import Frames
from clutchest.diagnosis.streams import compile_stream_tests
from clutchest.monitor.events import MonitorEvent
from clutchest.monitor.live_fault_tests import SHARE, FaultChange, LiveFaultTests
from clutchest.signals import Signal
from clutchest.vehicle import Vehicle

GATHER_S = 0.25  # s of a drive that are tested together
ADDRESS = 249  # J1939: an off-board service tool


class FaultWatcher:
    """A :class:`~clutchest.monitor.events.Watcher`: events of kind ``fault``.

    With ``send`` active codes are broadcast as DM1, once a second and whenever they change; an
    empty broadcast follows the last one.  ``share`` and ``log`` as
    :class:`~clutchest.monitor.live_fault_tests.LiveFaultTests` has them.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        database: Database,
        send: Callable[[Frames], None] | None = None,
        share: float | None = SHARE,
        log: Path | None = None,
    ) -> None:
        self.vehicle, self.database, self.share, self.log = vehicle, database, share, log
        compile_stream_tests(vehicle)  # before the first frame is due
        self._send = send
        self._tests: LiveFaultTests | None = None
        self._start_ns, self._tested_s = 0, 0.0
        self._signals: dict[str, Signal] = {}
        self._frames: list[Frames] = []
        self._codes: list[Code] = []
        self._sent_s = 0.0
        self._packets: deque[tuple[float, Frames]] = deque()

    def watch(
        self, signals: Mapping[str, Signal], frames: Frames, start_ns: int, now: float
    ) -> Iterable[MonitorEvent]:
        """See :class:`~clutchest.monitor.events.Watcher`."""
        if self._tests is None or start_ns != self._start_ns:
            self._begin(start_ns)
        for name, signal in signals.items():
            before = self._signals.get(name)
            self._signals[name] = signal if before is None else before.then(signal)
        self._frames.append(frames)
        events = self._test(now) if now - self._tested_s >= GATHER_S else []
        if self._send is not None:
            self._broadcast(time.monotonic())
        return events

    def finish(self, now: float) -> Iterable[MonitorEvent]:
        """See :class:`~clutchest.monitor.events.Watcher`."""
        if self._tests is None:
            return []
        events = self._test(now) + [_event(c) for c in self._tests.finish()]
        self._tests = None
        return events

    def close(self) -> None:
        """See :class:`~clutchest.monitor.events.Watcher`."""
        if self._tests is not None:
            self._tests.close()

    def _test(self, now: float) -> list[MonitorEvent]:
        """Events due to all data since the last test, up to ``now`` s."""
        assert self._tests is not None
        frames = Frames.concatenate(self._frames)
        changes = self._tests.take(self._signals, frames, self._start_ns, now)
        self._signals, self._frames, self._tested_s = {}, [], now
        return [_event(change) for change in changes]

    def _begin(self, start_ns: int) -> None:
        self.close()
        self._tests = LiveFaultTests(self.vehicle, self.database, share=self.share, log=self.log)
        self._start_ns, self._tested_s = start_ns, 0.0
        self._signals, self._frames = {}, []

    def _broadcast(self, now: float) -> None:
        assert self._tests is not None and self._send is not None
        codes = self._tests.codes
        due = now - self._sent_s >= EVERY_S and bool(codes)
        if (codes != self._codes or due) and not self._packets:
            frames = frames_of(codes, ADDRESS)
            rows = [frames.take(np.array([k])) for k in range(len(frames))]
            self._packets.extend((now + row.t_ns[0] / 1e9, row) for row in rows)
            self._codes, self._sent_s = codes, now
        while self._packets and self._packets[0][0] <= now:
            self._send(self._packets.popleft()[1])


def _event(change: FaultChange) -> MonitorEvent:
    data = {**asdict(change)["data"], "failed": change.failed, "set": list(change.set)}
    return MonitorEvent(change.time, "fault", change.fault, data)
