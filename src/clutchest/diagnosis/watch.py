"""Fault tests over a drive while it lasts.

Frames and signals are judged as they come.  What only the equations show is looked at every few
minutes, in a process of its own: all of the drive so far, as a replay would, so that what is found
live is what ``diagnose`` finds in the log.
"""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Future, ProcessPoolExecutor
from dataclasses import dataclass, field
from multiprocessing import get_context
from typing import Any

from clutchest.can.database import Database
from clutchest.can.dm1 import Code
from clutchest.can.frames import Frames
from clutchest.diagnosis.codes import number_of, number_of_set
from clutchest.diagnosis.streams import Streams
from clutchest.errors import ClutchestError
from clutchest.reading.mapping import mapped_messages
from clutchest.reading.traffic import ArrivingTraffic
from clutchest.signals import Signal, Signals
from clutchest.vehicle import Vehicle

REVIEW = 300.0  # s of driving between two looks at the equations


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

    ``review`` s of driving between two looks at the equations; None: none before the end.
    """

    def __init__(
        self, vehicle: Vehicle, database: Database, *, review: float | None = REVIEW
    ) -> None:
        self.vehicle, self.review = vehicle, review
        messages = [database.message(name) for name in mapped_messages(vehicle, database)]
        self.streams = Streams(vehicle)
        self.active: dict[str, Change] = {}
        self._traffic = ArrivingTraffic(messages, vehicle)
        self._kept: dict[str, list[Signal]] = {}
        self._told: set[str] = set()
        self._reviewed, self._now = 0.0, 0.0
        self._pool: ProcessPoolExecutor | None = None
        self._answer: Future[list[dict[str, Any]]] | None = None

    def take(
        self, signals: Mapping[str, Signal], frames: Frames, start_ns: int, until: float
    ) -> list[Change]:
        """What new ``signals`` and ``frames`` give reason to say; all up to ``until`` s have come.

        Times of signals count from ``start_ns``, the stamp of the drive's first frame.
        """
        self._now = until
        for name, signal in signals.items():
            self._kept.setdefault(name, []).append(signal)
        new = Signals(signals, traffic=self._traffic.take(frames, start_ns), end=until)
        self.streams.take(new, until)
        found = self._changes()
        if self._answer is not None and self._answer.done():
            found += self._equations(self._answer.result())
            self._answer = None
        due = self.review is not None and until - self._reviewed > self.review
        if due and self._answer is None:
            self._reviewed = until
            if self._pool is None:
                self._pool = ProcessPoolExecutor(1, get_context("spawn"))
            self._answer = self._pool.submit(looked_at, self._so_far(), self.vehicle)
        return found

    def finish(self) -> list[Change]:
        """The equations' last word, on the whole drive."""
        self.close()
        return self._equations(looked_at(self._so_far(), self.vehicle))

    def close(self) -> None:
        """Let go of the process that looks at the equations."""
        if self._pool is not None:
            self._pool.shutdown(wait=False, cancel_futures=True)
            self._pool = None

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
                data = {"began_s": alarm.begun, "what": alarm.what, "spn": spn, "fmi": fmi,
                        "set": [name]}  # fmt: skip
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

    def _so_far(self) -> Signals:
        whole = {name: Signal.joined(parts) for name, parts in self._kept.items()}
        return Signals(whole, end=self._now)


def looked_at(signals: Signals, vehicle: Vehicle) -> list[dict[str, Any]]:
    """The faults of a drive as ``diagnosis.json`` lists them; none where it tells too little."""
    from clutchest.diagnosis.diagnose import diagnose
    from clutchest.estimate.replay import replay

    try:
        return [fault.summary() for fault in diagnose(replay(signals, vehicle)).faults]
    except ClutchestError:
        return []
