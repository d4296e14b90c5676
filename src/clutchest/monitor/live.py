"""Online estimation: the estimates of a replay, as soon as no later frame can change them.

Frames go in as they are received.  The same decoding, timeline and compiled filter as in a replay
work on the last seconds only; an event is filtered once the look-ahead of everything that it
depends on is filled: samples between which inputs are interpolated, guard bands of mode changes,
averages at rest, inferred gears.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from clutchest.can.database import Database
from clutchest.can.frames import Frames
from clutchest.estimate.drive import Drive, Piece
from clutchest.estimate.impossible import BeginOfDrive
from clutchest.estimate.whole_log import compile_model
from clutchest.progress import Progress
from clutchest.reading.incoming import Decoded, Incoming
from clutchest.signals import HEAD, Signal
from clutchest.vehicle import Vehicle

CHECK_S = 0.25  # s between two checks whether a drive can begin


def compile_live(vehicle: Vehicle, progress: Progress | None = None) -> None:
    """Compile what a live drive with all mapped signals needs."""
    compile_model(vehicle, vehicle.machine.equations(set(vehicle.signals)), progress=progress)


class LiveEstimator:
    """Estimates of one drive while it lasts.

    ``rate`` Hz of the output grid; ``state`` as an earlier run left it; ``history`` returns all
    frames so far, for a signal that is first received so late that its earlier frames are no
    longer held.  Frames are given in order of time, no two with the same stamp.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        database: Database,
        *,
        rate: float = 10.0,
        state: Mapping[str, Any] | None = None,
        history: Callable[[], Frames] | None = None,
    ) -> None:
        self.vehicle, self.database, self.rate = vehicle, database, rate
        self.state, self.history = state, history
        self._waiting: list[Frames] = []
        self._checked_ns = self._last_ns = self._now_ns = 0
        self._running: tuple[Incoming, Drive] | None = None
        self._begin_of_drive = BeginOfDrive(vehicle)
        self.new_signals: Mapping[str, Signal] = {}  # the samples in the last frames

    @property
    def begun(self) -> bool:
        """Whether the signals at hand are known, and rows are being estimated."""
        return self._running is not None

    @property
    def due_ns(self) -> int | None:
        """When the next row may become final; None before the drive has begun."""
        if self._running is None:
            return None
        incoming, drive = self._running
        return incoming.start_ns + round(drive.due_s * 1e9)

    @property
    def complete(self) -> bool:
        """Whether every mapped signal has been received at least once."""
        return self._running is not None and self._running[0].complete

    @property
    def late(self) -> bool:
        """Whether a signal was first received too late for the estimates to use it."""
        return self._running is not None and self._running[0].late

    def take(self, frames: Frames, now_ns: int) -> Piece | None:
        """The rows that ``frames`` make final; every frame up to ``now_ns``, on their clock, has
        been received."""
        self._now_ns = now_ns
        if len(frames):
            self._last_ns = int(frames.t_ns[-1])
        if self._running is None:
            if len(frames):
                self._waiting.append(frames)
            return self._begin(now_ns)
        incoming, drive = self._running
        new = incoming.take(frames, now_ns)
        self.new_signals = new.signals
        self._judge(drive, (now_ns - incoming.start_ns) / 1e9)
        piece = drive.take(new.signals, new.settled)
        if incoming.late and self.history is not None:
            self._running, self._waiting = None, [self.history()]
            return self._begin(now_ns) or piece
        return piece

    def finish(self) -> Piece | None:
        """The remaining rows, up to the last frame or to the end of a silence that is being
        estimated.

        Raises ClutchestError if a signal that the model needs was never received.
        """
        if self._running is None:
            if not self._waiting:
                return None
            return self._started(Frames.concatenate(self._waiting), last=True)
        incoming, drive = self._running
        silent = drive.done > (self._last_ns - incoming.start_ns) / 1e9
        end_ns = self._now_ns if silent else self._last_ns
        rest = incoming.take(Frames.empty(), end_ns, last=True)
        self.new_signals = rest.signals
        self._judge(drive, (end_ns - incoming.start_ns) / 1e9, last=True)
        return drive.take(rest.signals, rest.settled, last=True)

    def _judge(self, drive: Drive, now: float, last: bool = False) -> None:
        """No row from ``now`` s on is valid where the new signals cannot be right."""
        found = self._begin_of_drive.take(self.new_signals, now, last)
        if found is not None:
            drive.consistency.contradict(replace(found, since_s=now))

    def final(self) -> dict[str, Any] | None:
        """What the next drive needs, as ``state.json`` holds it; None before the first estimate."""
        return None if self._running is None else self._running[1].final()

    def _begin(self, now_ns: int) -> Piece | None:
        """Begin once every mapped signal has been received for ``HEAD`` s, or after ``2 HEAD`` s
        without the optional ones."""
        if not self._waiting or now_ns - self._checked_ns < CHECK_S * 1e9:
            return None
        self._checked_ns = now_ns
        frames = Frames.concatenate(self._waiting)
        self._waiting = [frames]
        incoming = Incoming(self.vehicle, self.database, frames)
        first_s, settled = incoming.heard_s, incoming.first.settled
        model = self.vehicle.machine.equations(set(first_s))
        needed = {model.anchor, *(i.name for i in model.inputs if i.default is None)}
        needed -= set(model.slopes)
        if not needed <= set(first_s) or any(settled[n] < first_s[n] + HEAD for n in first_s):
            return None
        waited = (now_ns - incoming.start_ns) / 1e9 - max(first_s[name] for name in needed)
        if not set(self.vehicle.signals) <= set(first_s) and waited < 2 * HEAD:
            return None
        return self._started(frames, incoming)

    def _started(
        self, frames: Frames, incoming: Incoming | None = None, last: bool = False
    ) -> Piece | None:
        incoming = incoming or Incoming(self.vehicle, self.database, frames)
        drive = Drive(self.vehicle, incoming.heard_s, incoming.start_ns, self.rate, self.state)
        self._running = incoming, drive
        self._waiting = []
        first = incoming.first
        if last:
            rest = incoming.take(Frames.empty(), int(frames.t_ns[-1]), last=True)
            first = Decoded(
                {
                    n: s.then(rest.signals[n]) if n in rest.signals else s
                    for n, s in first.signals.items()
                },
                rest.settled,
            )
        self.new_signals = first.signals
        self._begin_of_drive = BeginOfDrive(self.vehicle)
        self._judge(drive, float(frames.t_ns[-1] - incoming.start_ns) / 1e9, last)
        return drive.take(first.signals, first.settled, last)
