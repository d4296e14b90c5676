"""Fault tests of a drive while it lasts.

Frames and single signals are tested as they are received.  The fault tests of the model equations
run in a process of their own, on the whole drive so far and with the same code as ``diagnose``, so
that a live session reports what ``diagnose`` reports of its log.  An analysis takes the longer the
longer the drive is: the next one waits until all of them together take no more than a given share
of one processor.  The last one runs at the end of the drive.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from time import process_time
from typing import Any

from clutchest.can import activity
from clutchest.can.database import Database
from clutchest.can.dm1 import Code
from clutchest.can.frames import Frames
from clutchest.diagnosis.codes import number_of
from clutchest.diagnosis.streams import StreamTests
from clutchest.errors import ClutchestError
from clutchest.monitor.worker import Worker
from clutchest.reading.traffic import TrafficStream
from clutchest.reading.wanted import mapped_messages
from clutchest.signals import LOST, Signal, Signals
from clutchest.vehicle import Vehicle

FIRST_S = 60.0  # s of driving before the first analysis of the equations
SHARE = 0.1  # of one processor, for analyses of the equations


@dataclass(frozen=True, slots=True)
class FaultChange:
    """A fault was detected (``failed``) or has healed at ``time`` s; ``set`` all that it may be."""

    time: float
    fault: str
    failed: bool
    set: tuple[str, ...]
    data: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class EquationFaults:
    """``faults`` of a drive as ``diagnosis.json`` lists them, and the processor time ``cost`` of
    the analysis, s."""

    faults: list[dict[str, Any]]
    cost: float


class LiveFaultTests:
    """All monitors of one drive.  Call :meth:`take` with every batch, :meth:`finish` at its end.

    ``share`` of one processor for analyses of the equations during the drive; None: none before
    its end.  ``log`` is a file that holds every frame by the time it is taken here, with the same
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
        self.streams = StreamTests(vehicle)
        self.active: dict[str, FaultChange] = {}
        self._traffic = TrafficStream(messages, vehicle)
        self._kept: dict[str, list[Signal]] = {}
        self._reported: set[str] = set()  # faults of the equations
        self._start_ns = 0
        self._now = self._received = self._analysed = 0.0
        self._due = FIRST_S
        self._worker: Worker | None = None
        self._pending = False

    def take(
        self, signals: Mapping[str, Signal], frames: Frames, start_ns: int, until: float
    ) -> list[FaultChange]:
        """Changes due to new ``signals`` and ``frames``, of which all up to ``until`` s have been
        received.

        Times of signals count from ``start_ns``, the stamp of the drive's first frame.
        """
        self._now, self._start_ns = until, start_ns
        if len(frames):
            self._received = (int(frames.t_ns[-1]) - start_ns) / 1e9
        if self.log is None:
            for name, signal in signals.items():
                self._kept.setdefault(name, []).append(signal)
        new = Signals(
            signals,
            traffic=self._traffic.take(frames, start_ns),
            activity=activity.times(frames, start_ns),
            end=until,
        )
        self.streams.take(new, until)
        changes = self._stream_changes()
        if self._worker is not None and self._worker.done:  # or dead, which is said there
            changes += self._result()
        if not self._pending and self.share is not None and self._is_due():
            self._submit()
        return changes

    def finish(self) -> list[FaultChange]:
        """Changes due to the equations' fault tests of the whole drive."""
        changes = self._result() if self._pending else []
        if self._received > self._analysed:
            if self._worker is None:
                changes += self._equation_changes(equation_faults(*self._so_far()).faults)
            else:
                self._submit()
                changes += self._result()
        self.close()
        return changes

    def close(self) -> None:
        """Shut down the process that analyses the equations."""
        if self._worker is not None:
            self._worker.close()
            self._worker = None

    def _is_due(self) -> bool:
        """Whether there are new data and an analysis is due, or the bus is silent."""
        if self._received <= self._analysed or self._now < FIRST_S:
            return False
        return self._now >= self._due or self._now - self._received > LOST

    def _submit(self) -> None:
        if self._worker is None:
            self._worker = Worker("the fault tests of the equations")
        self._analysed = self._received
        self._worker.submit(equation_faults, *self._so_far())
        self._pending = True

    def _result(self) -> list[FaultChange]:
        assert self._worker is not None
        result: EquationFaults = self._worker.result()
        self._pending = False
        if self.share is not None:
            self._due = self._analysed + result.cost / self.share
        return self._equation_changes(result.faults)

    @property
    def codes(self) -> list[Code]:
        """Trouble codes of the active faults, for a DM1; a set has no component's code."""
        stated = [change.data for change in self.active.values()]
        return list(dict.fromkeys(Code(each["spn"], each["fmi"]) for each in stated))

    def _stream_changes(self) -> list[FaultChange]:
        changes = []
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
                self.active[name] = FaultChange(alarm.detected, name, True, (name,), data)
                changes.append(self.active[name])
            elif not test.failing and name in self.active:
                ended = test.alarms[-1].ended
                time = self._now if ended is None else ended
                del self.active[name]
                changes.append(FaultChange(time, name, False, (name,)))
        return changes

    def _equation_changes(self, faults: list[dict[str, Any]]) -> list[FaultChange]:
        changes = []
        streams = {test.name for test in self.streams.tests}
        for fault in faults:
            name = fault["fault"]
            if name in streams or name in self._reported:
                continue
            self._reported.add(name)
            causes = fault["causes"]
            data = {**fault, "size": causes[0]["size"] if causes else 0.0}
            change = FaultChange(fault["first_detected_s"], name, True, tuple(fault["set"]), data)
            self.active[name] = change
            changes.append(change)
        return changes

    def _so_far(self) -> tuple[Vehicle, Signals | Path, int]:
        if self.log is not None:
            return self.vehicle, self.log, self._start_ns
        whole = {name: Signal.joined(parts) for name, parts in self._kept.items()}
        self._kept = {name: [signal] for name, signal in whole.items()}
        return self.vehicle, Signals(whole, end=self._now), self._start_ns


def equation_faults(vehicle: Vehicle, drive: Signals | Path, start_ns: int) -> EquationFaults:
    """The faults of a drive, or of a log from ``start_ns`` on; none where that is too short for an
    estimate."""
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
    return EquationFaults(faults, process_time() - begun)
