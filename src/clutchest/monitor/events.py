"""Events of a live session, and the interface of those that watch a drive and raise them."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

from clutchest.can.frames import Frames
from clutchest.estimate.drive import Piece
from clutchest.signals import Signal

SHOWN = 12  # latest events in a status


@dataclass(frozen=True, slots=True)
class MonitorEvent:
    """Something that happened: ``time`` s from the drive's first frame, ``kind`` mode, engagement,
    tracking, fault, gap, reconnect or warning."""

    time: float
    kind: str
    name: str
    data: Mapping[str, Any] = field(default_factory=dict)


@runtime_checkable
class Watcher(Protocol):
    """Receives all data of a drive and may raise events: fault tests."""

    def watch(
        self, signals: Mapping[str, Signal], frames: Frames, start_ns: int, now: float
    ) -> Iterable[MonitorEvent]:
        """Events due to new ``signals`` and ``frames``, of which all up to ``now`` s have been
        received.

        Times count from ``start_ns``, the stamp of the drive's first frame.  The first call of a
        drive brings all data since its start.
        """
        ...

    def finish(self, now: float) -> Iterable[MonitorEvent]:
        """Events due to the whole drive, which ends at ``now`` s; may take long."""
        ...

    def close(self) -> None:
        """The session ends."""
        ...


@dataclass
class SessionStatus:
    """The state of a session, as a panel shows it."""

    vehicle: str
    frames: int = 0
    lost: int = 0
    losses_known: bool = False
    malformed: int = 0
    rows: int = 0
    now: float = 0.0
    piece: Piece | None = None
    events: deque[MonitorEvent] = field(default_factory=lambda: deque(maxlen=SHOWN))
    warnings: tuple[str, ...] = ()
    away: str = ""
    silent_s: float = 0.0
    address: str = ""
    latency_s: deque[float] = field(default_factory=lambda: deque(maxlen=1000))

    def __repr__(self) -> str:
        rows = f"{self.frames} frames ({self.losses}), {self.rows} rows"
        return f"<SessionStatus: {self.vehicle}, {self.now:.1f} s, {rows}>"

    @property
    def losses(self) -> str:
        """Frames that were lost, and what was no frame, in words."""
        if self.losses_known:
            lost = f"{self.lost} lost"
        else:
            lost = f"at least {self.lost} lost" if self.lost else "lost: not known"
        return lost + (f", {self.malformed} malformed" if self.malformed else "")


Show = Callable[[SessionStatus, Piece | None, Sequence[MonitorEvent]], None]
