"""Decoding of a drive that is going on, frames by frames, to the same numbers as at its end."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from clutchest.can import transport
from clutchest.can.database import Database
from clutchest.can.frames import Frames
from clutchest.can.transport import reassembled
from clutchest.reading.gears import LOOK_AHEAD, engaged_gear
from clutchest.reading.mapping import Decoding
from clutchest.reading.wanted import mapped_messages, parts
from clutchest.signals import LOST, Signal
from clutchest.vehicle import BusSignal, Vehicle

TRANSFER = 10_000_000_000  # ns; a message in packets takes no longer
BEFORE = 1.0  # s kept behind the last gear that is known: pieces and averages reach that far


@dataclass(frozen=True, slots=True)
class Decoded:
    """New samples by canonical name, and up to when, s, each signal is complete."""

    signals: Mapping[str, Signal]
    settled: Mapping[str, float]


class Incoming:
    """Decodes ``frames``, the drive so far, when it is made, and what follows by :meth:`take`.

    Whom a signal is taken from, and how its gear is known, is decided by the drive so far; ``late``
    turns True when something is heard for the first time later.  Frames come in order of time, no
    two with the same stamp; t = 0 is at the first one.
    """

    def __init__(self, vehicle: Vehicle, database: Database, frames: Frames) -> None:
        self.vehicle, self.database = vehicle, database
        self.start_ns = int(frames.t_ns[0])
        self._mapped = mapped_messages(vehicle, database)
        self._wanted = [database.message(name) for name in self._mapped]
        self._long = any(transport.may_carry(message) for message in self._wanted)
        self.late = False
        self._senders: dict[tuple[str, BusSignal], int] = {}
        self._decided = False
        self._remembered = frames.take(slice(0))  # what the frames to come may need
        self._last: dict[tuple[str, BusSignal], int] = {}  # rows of these, of each companion
        self._geared: dict[str, _Geared] = {}
        self.first = self.take(frames, int(frames.t_ns[-1]))
        self.heard_s = {
            name: float(s.time[s.valid][0])
            for name, s in self.first.signals.items()
            if s.valid.any()
        }
        self._decided = True

    @property
    def complete(self) -> bool:
        """Whether everything that the vehicle file maps has been heard."""
        wanted = [(name, bus) for name, s in self.vehicle.signals.items() for bus in parts(s)]
        return set(wanted) <= set(self._senders)

    def take(self, frames: Frames, now_ns: int, last: bool = False) -> Decoded:
        """What ``frames`` add; everything up to ``now_ns`` has come, and nothing will after the
        ``last``."""
        known = len(self._senders)
        after = (int(frames.t_ns[0]) - self.start_ns) / 1e9 if len(frames) else np.inf
        before = self._remembered
        drive = Frames.concatenate([before, frames])
        whole = reassembled(drive, self._wanted) if self._long else drive
        decoding = Decoding(
            whole,
            self.vehicle,
            self.database,
            senders=self._senders,
            start_ns=self.start_ns,
            account=None,
            wanted=self._mapped,
        )
        decoding.decode()
        names = decoding.touched(0 if self._long else len(before))
        made, wheels = decoding.canonical(names)
        self.late |= self._decided and len(self._senders) != known
        self._remember(whole, decoding.remembered(names))
        if self._long:
            packets = transport.belongs(drive) & (drive.t_ns > now_ns - TRANSFER)
            self._remembered = Frames.concatenate([self._remembered, drive.take(packets)]).sorted()
            self._last = {}  # where everything is decoded anew every time
        now = (now_ns - self.start_ns) / 1e9
        signals = {name: _since(signal, after) for name, signal in made.items()}
        settled = dict.fromkeys(self.vehicle.signals, now)
        for name, wheel in wheels.items():
            self._geared.setdefault(name, _Geared(self.vehicle.signals[name].gears))
            self._geared[name].wheel.append(_since(wheel, after))
        for name, geared in self._geared.items():
            column = self.vehicle.machine.column(name)
            if column and column.geared_by in signals:
                geared.engine.append(signals[column.geared_by].only_valid())
            signals[name], settled[name] = geared.take(now, last)
        return Decoded(signals, settled)

    def _remember(self, frames: Frames, last: dict[tuple[str, BusSignal], int]) -> None:
        """Keep the rows in which companions said something at last; those of which nothing came
        are among ``frames`` where they were."""
        last = {**self._last, **last}
        rows = sorted(set(last.values()))
        self._last = {key: rows.index(row) for key, row in last.items()}
        self._remembered = frames.take(np.array(rows, np.intp))


def _since(signal: Signal, time: float) -> Signal:
    """The samples from ``time`` s on: what was remembered has been taken already."""
    first = int(np.searchsorted(signal.time, time))
    return signal.take(slice(first, None)) if first else signal


class _Samples:
    """Samples of one signal, of which the older ones are forgotten."""

    def __init__(self) -> None:
        self.signal: Signal | None = None

    def append(self, new: Signal) -> None:
        self.signal = new if self.signal is None else self.signal.then(new)

    def forget(self, before: float) -> None:
        """All but the last sample before ``before`` s."""
        if self.signal is not None and len(self.signal):
            first = max(int(np.searchsorted(self.signal.time, before)) - 1, 0)
            self.signal = _since(self.signal, float(self.signal.time[first]))


class _Geared:
    """A wheel speed that waits until its gear is known."""

    def __init__(self, gears: tuple[float, ...]) -> None:
        self.gears = np.array(gears)
        self.wheel, self.engine = _Samples(), _Samples()
        self.before, self.done = 0, -np.inf

    def take(self, now: float, last: bool) -> tuple[Signal, float]:
        """The shaft speed that is new, and up to when it is complete, s."""
        wheel, engine = self.wheel.signal, self.engine.signal
        assert wheel is not None
        if engine is None or not len(engine):
            seen, speed = now - LOST, np.full(len(wheel), np.nan)
        else:  # behind the last engine speed nobody knows yet how it goes on
            quiet = now - engine.time[-1] > LOST
            seen, speed = now if quiet else float(engine.time[-1]), engine.at(wheel.time)
        upto = now if last else max(seen - LOOK_AHEAD, self.done)
        found = engaged_gear(wheel.time, wheel.value, speed, self.gears.tolist(), self.before)
        new = slice(*np.searchsorted(wheel.time, [self.done, upto], side="right"))
        shaft = replace(wheel, value=wheel.value * self.gears[found.gear]).take(new)
        keep = max(int(np.searchsorted(wheel.time, upto - BEFORE)) - 1, 0)
        if len(found.held):
            self.before = int(found.held[keep])
            self.wheel.forget(upto - BEFORE)
        self.engine.forget(upto - BEFORE)
        self.done = upto
        return shaft, upto
