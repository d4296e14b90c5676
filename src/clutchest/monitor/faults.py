"""Fault tests of a live drive, and trouble codes told to the bus."""

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
from clutchest.diagnosis.streams import ready
from clutchest.diagnosis.watch import SHARE, Change, FaultWatch
from clutchest.monitor.monitor import Event
from clutchest.signals import Signal
from clutchest.vehicle import Vehicle

GATHER = 0.25  # s of a drive that are judged together
ADDRESS = 249  # J1939: an off-board service tool


class Faults:
    """A :class:`~clutchest.monitor.monitor.Watcher`: events of kind ``fault``.

    With ``send`` active codes are broadcast as DM1, once a second and whenever they change; a
    broadcast that says "none" follows the last one.  ``share`` and ``log`` as
    :class:`~clutchest.diagnosis.watch.FaultWatch` has them.
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
        ready(vehicle)  # compiled before the first frame is due
        self._send = send
        self._watch: FaultWatch | None = None
        self._start_ns, self._taken = 0, 0.0
        self._signals: dict[str, Signal] = {}
        self._frames: list[Frames] = []
        self._codes: list[Code] = []
        self._said = 0.0
        self._packets: deque[tuple[float, Frames]] = deque()

    def watch(
        self, signals: Mapping[str, Signal], frames: Frames, start_ns: int, now: float
    ) -> Iterable[Event]:
        """See :class:`~clutchest.monitor.monitor.Watcher`."""
        if self._watch is None or start_ns != self._start_ns:
            self._begin(start_ns)
        for name, signal in signals.items():
            before = self._signals.get(name)
            self._signals[name] = signal if before is None else before.then(signal)
        self._frames.append(frames)
        found = self._taken_in(now) if now - self._taken >= GATHER else []
        if self._send is not None:
            self._tell_bus(time.monotonic())
        return found

    def finish(self, now: float) -> Iterable[Event]:
        """See :class:`~clutchest.monitor.monitor.Watcher`."""
        if self._watch is None:
            return []
        found = self._taken_in(now) + [_event(c) for c in self._watch.finish()]
        self._watch = None
        return found

    def close(self) -> None:
        """End what runs beside."""
        if self._watch is not None:
            self._watch.close()

    def _taken_in(self, now: float) -> list[Event]:
        """What comes of everything since the last time, up to ``now`` s."""
        assert self._watch is not None
        both = Frames.concatenate(self._frames)
        changes = self._watch.take(self._signals, both, self._start_ns, now)
        self._signals, self._frames, self._taken = {}, [], now
        return [_event(change) for change in changes]

    def _begin(self, start_ns: int) -> None:
        self.close()
        self._watch = FaultWatch(self.vehicle, self.database, share=self.share, log=self.log)
        self._start_ns, self._taken = start_ns, 0.0
        self._signals, self._frames = {}, []

    def _tell_bus(self, now: float) -> None:
        assert self._watch is not None and self._send is not None
        codes = self._watch.codes
        due = now - self._said >= EVERY_S and bool(codes)
        if (codes != self._codes or due) and not self._packets:
            frames = frames_of(codes, ADDRESS)
            rows = [frames.take(np.array([k])) for k in range(len(frames))]
            self._packets.extend((now + row.t_ns[0] / 1e9, row) for row in rows)
            self._codes, self._said = codes, now
        while self._packets and self._packets[0][0] <= now:
            self._send(self._packets.popleft()[1])


def _event(change: Change) -> Event:
    told = asdict(change)
    data = {**told["data"], "failed": change.failed, "set": list(change.set)}
    return Event(change.time, "fault", change.fault, data)
