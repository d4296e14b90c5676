"""A drive that is going on: the estimates of a replay, as soon as nothing can change them any more.

Frames go in as they come.  The same decoding, timeline and compiled filter as in a replay work on
the last seconds only; an event is filtered once the look-ahead of everything that judges it is
filled: samples that inputs run straight to, the modes' guards, averages at rest, inferred gears.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from clutchest.can.database import Database
from clutchest.can.frames import Frames
from clutchest.estimate.drive import Drive, Piece
from clutchest.estimate.whole_log import compile_model
from clutchest.progress import Progress
from clutchest.reading.incoming import Decoded, Incoming
from clutchest.signals import HEAD, Signal
from clutchest.vehicle import Vehicle

ASK = 0.25  # s between two looks at whether a drive has begun


def ready(vehicle: Vehicle, progress: Progress | None = None) -> None:
    """Compile what a live drive with all mapped signals will need."""
    compile_model(vehicle, vehicle.machine.equations(set(vehicle.signals)), progress=progress)


class Live:
    """Estimates over a drive while it lasts.

    ``rate`` Hz of the output grid; ``state`` as an earlier run left it; ``history`` gives all
    frames so far, for the case that a signal is heard for the first time so late that its frames
    are no longer held.  Frames come in order of time, no two with the same stamp.
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
        self._asked_ns = self._last_ns = self._now_ns = 0
        self._going: tuple[Incoming, Drive] | None = None
        self.arrived: Mapping[str, Signal] = {}  # the samples that the last frames brought

    @property
    def begun(self) -> bool:
        """Whether it is known what can be estimated, and estimates come."""
        return self._going is not None

    @property
    def due_ns(self) -> int | None:
        """When the next row may become certain; None while nobody can say."""
        if self._going is None:
            return None
        incoming, drive = self._going
        return incoming.start_ns + round(drive.due_s * 1e9)

    @property
    def complete(self) -> bool:
        """Whether nothing mapped is left to be heard for the first time."""
        return self._going is not None and self._going[0].complete

    @property
    def late(self) -> bool:
        """Whether something was heard for the first time that the estimates do not use."""
        return self._going is not None and self._going[0].late

    def take(self, frames: Frames, now_ns: int) -> Piece | None:
        """What ``frames`` make certain; all up to ``now_ns`` have come, on their clock."""
        self._now_ns = now_ns
        if len(frames):
            self._last_ns = int(frames.t_ns[-1])
        if self._going is None:
            if len(frames):
                self._waiting.append(frames)
            return self._begin(now_ns)
        incoming, drive = self._going
        new = incoming.take(frames, now_ns)
        self.arrived = new.signals
        piece = drive.take(new.signals, new.settled)
        if incoming.late and self.history is not None:
            self._going, self._waiting = None, [self.history()]
            return self._begin(now_ns) or piece
        return piece

    def finish(self) -> Piece | None:
        """The rest, up to the last frame, or as far as a silence behind it has been told of.

        Raises ClutchestError if a signal that the model needs never came.
        """
        if self._going is None:
            if not self._waiting:
                return None
            return self._started(Frames.concatenate(self._waiting), last=True)
        incoming, drive = self._going
        silent = drive.done > (self._last_ns - incoming.start_ns) / 1e9
        upto = self._now_ns if silent else self._last_ns
        rest = incoming.take(Frames.empty(), upto, last=True)
        self.arrived = rest.signals
        return drive.take(rest.signals, rest.settled, last=True)

    def final(self) -> dict[str, Any] | None:
        """What the next drive needs, as ``state.json`` holds it; None before the first estimate."""
        return None if self._going is None else self._going[1].final()

    def _begin(self, now_ns: int) -> Piece | None:
        """Begin once every mapped signal has been heard for ``HEAD`` s, or waiting is no use."""
        if not self._waiting or now_ns - self._asked_ns < ASK * 1e9:
            return None
        self._asked_ns = now_ns
        frames = Frames.concatenate(self._waiting)
        self._waiting = [frames]
        incoming = Incoming(self.vehicle, self.database, frames)
        heard, settled = incoming.heard_s, incoming.first.settled
        model = self.vehicle.machine.equations(set(heard))
        needed = {model.anchor, *(i.name for i in model.inputs if i.default is None)}
        needed -= set(model.slopes)
        if not needed <= set(heard) or any(settled[n] < heard[n] + HEAD for n in heard):
            return None
        waited = (now_ns - incoming.start_ns) / 1e9 - max(heard[name] for name in needed)
        if not set(self.vehicle.signals) <= set(heard) and waited < 2 * HEAD:
            return None
        return self._started(frames, incoming)

    def _started(
        self, frames: Frames, incoming: Incoming | None = None, last: bool = False
    ) -> Piece | None:
        incoming = incoming or Incoming(self.vehicle, self.database, frames)
        drive = Drive(self.vehicle, incoming.heard_s, incoming.start_ns, self.rate, self.state)
        self._going = incoming, drive
        self._waiting = []
        first = incoming.first
        self.arrived = first.signals
        if last:
            rest = incoming.take(Frames.empty(), int(frames.t_ns[-1]), last=True)
            first = Decoded(
                {
                    n: s.then(rest.signals[n]) if n in rest.signals else s
                    for n, s in first.signals.items()
                },
                rest.settled,
            )
        return drive.take(first.signals, first.settled, last)
