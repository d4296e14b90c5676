"""Fault tests over a drive while it lasts.

Frames and signals are judged as they come.  What only the equations show is looked at in a process
of its own: all of the drive so far, as a replay would, so that what is found live is what
``diagnose`` finds in the log.  A look takes the longer the longer the drive is: the next one waits
until all of them together take no more than a share of one processor.  The last one is at the end.
"""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Future, ProcessPoolExecutor
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path
from time import process_time
from typing import Any

from clutchest.can.database import Database
from clutchest.can.dm1 import Code
from clutchest.can.frames import Frames
from clutchest.diagnosis.codes import number_of, number_of_set
from clutchest.diagnosis.streams import Streams
from clutchest.errors import ClutchestError
from clutchest.reading.traffic import TrafficStream
from clutchest.reading.wanted import mapped_messages
from clutchest.signals import LOST, Signal, Signals
from clutchest.vehicle import Vehicle

FIRST = 60.0  # s of driving before the first look at the equations
SHARE = 0.1  # of one processor, that looks at the equations may take


@dataclass(frozen=True, slots=True)
class Change:
    """A fault came (``failed``) or went at ``time`` s; ``set`` all that it may be."""

    time: float
    fault: str
    failed: bool
    set: tuple[str, ...]
    data: Mapping[str, Any] = field(default_factory=dict)


class FaultWatch:
    """All monitors of one drive.  Call :meth:`take` with every batch, :meth:`finish` at its end.

    ``share`` of one processor for looks at the equations while the drive lasts; None: none before
    the end.  ``log`` is a file that holds every frame by the time it is taken here, with the same
    stamps; without one the drive's signals are held in memory.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        database: Database,
        *,
        share: float | None = SHARE,
        log: Path | None = None,
    ) -> None:
        self.vehicle, self.share, self.log = vehicle, share, log
        messages = [database.message(name) for name in mapped_messages(vehicle, database)]
        self.streams = Streams(vehicle)
        self.active: dict[str, Change] = {}
        self._traffic = TrafficStream(messages, vehicle)
        self._kept: dict[str, list[Signal]] = {}
        self._told: set[str] = set()
        self._start_ns = 0
        self._now = self._heard = self._looked = 0.0
        self._due = FIRST
        self._pool: ProcessPoolExecutor | None = None
        self._answer: Future[Look] | None = None

    def take(
        self, signals: Mapping[str, Signal], frames: Frames, start_ns: int, until: float
    ) -> list[Change]:
        """What new ``signals`` and ``frames`` give reason to say; all up to ``until`` s have come.

        Times of signals count from ``start_ns``, the stamp of the drive's first frame.
        """
        self._now, self._start_ns = until, start_ns
        if len(frames):
            self._heard = (int(frames.t_ns[-1]) - start_ns) / 1e9
        if self.log is None:
            for name, signal in signals.items():
                self._kept.setdefault(name, []).append(signal)
        new = Signals(signals, traffic=self._traffic.take(frames, start_ns), end=until)
        self.streams.take(new, until)
        found = self._changes()
        if self._answer is not None and self._answer.done():
            found += self._answered()
        if self._answer is None and self.share is not None and self._worth_a_look():
            self._ask()
        return found

    def finish(self) -> list[Change]:
        """The equations' last word, on the whole drive."""
        found = [] if self._answer is None else self._answered()
        if self._heard > self._looked:
            if self._pool is None:
                found += self._equations(looked_at(*self._so_far()).faults)
            else:
                self._ask()
                found += self._answered()
        self.close()
        return found

    def close(self) -> None:
        """Let go of the process that looks at the equations."""
        if self._pool is not None:
            self._pool.shutdown(wait=False, cancel_futures=True)
            self._pool = None

    def _worth_a_look(self) -> bool:
        """Whether it is time, or the vehicle rests and there is news of it."""
        if self._heard <= self._looked or self._now < FIRST:
            return False
        return self._now >= self._due or self._now - self._heard > LOST

    def _ask(self) -> None:
        if self._pool is None:
            self._pool = ProcessPoolExecutor(1, get_context("spawn"))
        self._looked = self._heard
        self._answer = self._pool.submit(looked_at, *self._so_far())

    def _answered(self) -> list[Change]:
        assert self._answer is not None
        look, self._answer = self._answer.result(), None
        if self.share is not None:
            self._due = self._looked + look.cost / self.share
        return self._equations(look.faults)

    @property
    def codes(self) -> list[Code]:
        """Trouble codes of what is active, for a DM1; a set has no component's."""
        found = []
        for change in self.active.values():
            size = change.data.get("size", 0.0)
            found.append(Code(*number_of_set(change.set, self.vehicle, size)))
        return list(dict.fromkeys(found))

    def _changes(self) -> list[Change]:
        found = []
        for test in self.streams.tests:
            name = test.name
            if test.failing and name not in self.active:
                alarm = test.alarms[-1]
                spn, fmi = number_of(name, self.vehicle)
                data = {
                    "began_s": alarm.begun,
                    "what": alarm.what,
                    "spn": spn,
                    "fmi": fmi,
                    "set": [name],
                }
                self.active[name] = Change(alarm.detected, name, True, (name,), data)
                found.append(self.active[name])
            elif not test.failing and name in self.active:
                ended = test.alarms[-1].ended
                del self.active[name]
                found.append(Change(self._now if ended is None else ended, name, False, (name,)))
        return found

    def _equations(self, faults: list[dict[str, Any]]) -> list[Change]:
        found = []
        streams = {test.name for test in self.streams.tests}
        for fault in faults:
            name = fault["fault"]
            if name in streams or name in self._told:
                continue
            self._told.add(name)
            causes = fault["causes"]
            data = {**fault, "size": causes[0]["size"] if causes else 0.0}
            change = Change(fault["first_detected_s"], name, True, tuple(fault["set"]), data)
            self.active[name] = change
            found.append(change)
        return found

    def _so_far(self) -> tuple[Vehicle, Signals | Path, int]:
        if self.log is not None:
            return self.vehicle, self.log, self._start_ns
        whole = {name: Signal.joined(parts) for name, parts in self._kept.items()}
        self._kept = {name: [signal] for name, signal in whole.items()}
        return self.vehicle, Signals(whole, end=self._now), self._start_ns


@dataclass(frozen=True, slots=True)
class Look:
    """``faults`` of a drive as ``diagnosis.json`` lists them, and what it took, ``cost`` s of one
    processor."""

    faults: list[dict[str, Any]]
    cost: float


def looked_at(vehicle: Vehicle, drive: Signals | Path, start_ns: int) -> Look:
    """The faults of a drive, or of what a log has from ``start_ns`` on; none where that tells too
    little."""
    from clutchest.can.files import read_frames
    from clutchest.diagnosis.diagnose import diagnose
    from clutchest.estimate.replay import replay
    from clutchest.reading.log import load_database
    from clutchest.reading.mapping import signals_of

    begun = process_time()
    try:
        if isinstance(drive, Path):
            frames = read_frames(drive)
            frames = frames.take(frames.t_ns >= start_ns)
            drive = signals_of(frames, vehicle, load_database(vehicle))
        faults = [fault.summary() for fault in diagnose(replay(drive, vehicle)).faults]
    except ClutchestError:
        faults = []
    return Look(faults, process_time() - begun)
