"""Decoding of a drive in progress, batch by batch of frames, to the same numbers as at its end."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from clutchest.can import transport
from clutchest.can.database import Database
from clutchest.can.frames import Frames
from clutchest.can.transport import reassembled
from clutchest.reading.gears import SETTLED, engaged_gear
from clutchest.reading.mapping import Decoding
from clutchest.reading.wanted import mapped_messages, parts
from clutchest.signals import LOST, Signal
from clutchest.vehicle import BusSignal, Vehicle

TRANSFER = 10_000_000_000  # ns; a message in packets takes no longer
BEFORE = 1.0  # s kept before the last gear that is known: pieces and averages reach that far


@dataclass(frozen=True, slots=True)
class Decoded:
    """New samples by canonical name, and up to when, s, each signal is complete."""

    signals: Mapping[str, Signal]
    settled: Mapping[str, float]


class Incoming:
    """Decodes ``frames``, the drive so far, when it is made, and what follows by :meth:`take`.

    The sender of each signal, and whether its gear is sent, are chosen by the drive so far;
    ``late`` turns True when a further one is received for the first time.  Frames come in order of
    time, no two with the same stamp; t = 0 is at the first one.
    """

    def __init__(self, vehicle: Vehicle, database: Database, frames: Frames) -> None:
        self.vehicle, self.database = vehicle, database
        self.start_ns = int(frames.t_ns[0])
        self._mapped = mapped_messages(vehicle, database)
        self._wanted = [database.message(name) for name in self._mapped]
        self._long = any(transport.may_carry(message) for message in self._wanted)
        self.late = False
        self._senders: dict[tuple[str, BusSignal], int] = {}
        self._kept = frames.take(slice(0))  # frames that later ones may need
        self._last: dict[tuple[str, BusSignal], int] = {}  # rows of these, of each companion
        self._geared: dict[str, _Geared] = {}
        self.first = self.take(frames, int(frames.t_ns[-1]))
        self.heard_s = {
            name: float(s.time[s.valid][0])
            for name, s in self.first.signals.items()
            if s.valid.any()
        }
        self.late = False  # the senders of the drive so far are those to expect

    @property
    def complete(self) -> bool:
        """Whether everything that the vehicle file maps has been received."""
        wanted = [(name, bus) for name, s in self.vehicle.signals.items() for bus in parts(s)]
        return set(wanted) <= set(self._senders)

    def take(self, frames: Frames, now_ns: int, last: bool = False) -> Decoded:
        """What ``frames`` add: all up to ``now_ns``; after the ``last`` there are no more."""
        after = (int(frames.t_ns[0]) - self.start_ns) / 1e9 if len(frames) else np.inf
        drive = Frames.concatenate([self._kept, frames])
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
        decoding.locate_messages()
        names = decoding.carried_from(0 if self._long else len(self._kept))
        made, wheel_speeds = decoding.canonical(names)
        self._keep(whole, decoding.last_valid_rows(names))
        if self._long:
            packets = transport.belongs(drive) & (drive.t_ns > now_ns - TRANSFER)
            self._kept = Frames.concatenate([self._kept, drive.take(packets)]).sorted()
            self._last = {}  # everything is decoded anew every time
        self.late |= len(decoding.senders) != len(self._senders)
        self._senders = decoding.senders
        now = (now_ns - self.start_ns) / 1e9
        signals = {name: _since(signal, after) for name, signal in made.items()}
        return self._with_geared(signals, wheel_speeds, after, now, last)

    def _with_geared(
        self,
        signals: dict[str, Signal],
        wheel_speeds: Mapping[str, Signal],
        after: float,
        now: float,
        last: bool,
    ) -> Decoded:
        """The new ``signals`` and those that inferred gears make of ``wheel_speeds`` from ``after``
        s on, with all known up to ``now`` s."""
        settled = dict.fromkeys(self.vehicle.signals, now)
        for name, wheel in wheel_speeds.items():
            self._geared.setdefault(name, _Geared(self.vehicle.signals[name].gears))
            self._geared[name].wheel.append(_since(wheel, after))
        for name, geared in self._geared.items():
            column = self.vehicle.machine.column(name)
            if column and column.geared_by in signals:
                geared.engine.append(signals[column.geared_by].only_valid())
            signals[name], settled[name] = geared.take(now, last)
        return Decoded(signals, settled)

    def _keep(self, frames: Frames, last: Mapping[tuple[str, BusSignal], int]) -> None:
        """Keep the frames with the last valid sample of each companion: these ``last`` rows of
        ``frames``, and the rows known before of those without a new one."""
        rows_of = {**self._last, **last}
        rows = sorted(set(rows_of.values()))
        self._last = {key: rows.index(row) for key, row in rows_of.items()}
        self._kept = frames.take(np.array(rows, np.intp))


def _since(signal: Signal, time: float) -> Signal:
    """The samples from ``time`` s on."""
    first = int(np.searchsorted(signal.time, time))
    return signal.take(slice(first, None)) if first else signal


class _Samples:
    """The latest samples of one signal."""

    def __init__(self) -> None:
        self.signal: Signal | None = None

    def append(self, new: Signal) -> None:
        self.signal = new if self.signal is None else self.signal.then(new)

    def drop(self, before: float) -> None:
        """Drop all but the last sample before ``before`` s."""
        if self.signal is not None and len(self.signal):
            first = max(int(np.searchsorted(self.signal.time, before)) - 1, 0)
            self.signal = _since(self.signal, float(self.signal.time[first]))


class _Geared:
    """A wheel speed, kept until its gear is known."""

    def __init__(self, gears: tuple[float, ...]) -> None:
        self.gears = np.array(gears)
        self.wheel, self.engine = _Samples(), _Samples()
        self.held, self.done = 0, -np.inf  # the gear at the first sample kept; s

    def take(self, now: float, last: bool) -> tuple[Signal, float]:
        """The shaft speed that is new, and up to when it is complete, s."""
        wheel, engine = self.wheel.signal, self.engine.signal
        assert wheel is not None
        if engine is None or not len(engine):
            known, speed = now - LOST, np.full(len(wheel), np.nan)
        else:  # beyond its last sample the engine speed is unknown until the next, or lost
            lost = now - engine.time[-1] > LOST
            known, speed = now if lost else float(engine.time[-1]), engine.at(wheel.time)
        until = now if last else max(known - SETTLED, self.done)
        engaged = engaged_gear(wheel.time, wheel.value, speed, self.gears.tolist(), self.held)
        new = slice(*np.searchsorted(wheel.time, [self.done, until], side="right"))
        shaft = replace(wheel, value=wheel.value * self.gears[engaged.gear]).take(new)
        keep = max(int(np.searchsorted(wheel.time, until - BEFORE)) - 1, 0)
        if len(engaged.held):
            self.held = int(engaged.held[keep])
            self.wheel.drop(until - BEFORE)
        self.engine.drop(until - BEFORE)
        self.done = until
        return shaft, until
