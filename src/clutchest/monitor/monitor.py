"""The monitor: a bus in, estimates as soon as they are certain, events, and the files of both."""

from __future__ import annotations

import gc
import queue
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from clutchest.can.bus import Received, filters
from clutchest.can.encode import check
from clutchest.can.frames import Frames
from clutchest.errors import ClutchestError
from clutchest.estimate.drive import Piece
from clutchest.estimate.live import Live, ready
from clutchest.estimate.replay import provenance
from clutchest.monitor.listener import Listener, Trouble
from clutchest.monitor.silence import Silence
from clutchest.monitor.stamps import Stamps
from clutchest.monitor.store import Session
from clutchest.progress import Progress
from clutchest.reading.log import HOLE_S, load_database
from clutchest.reading.wanted import mapped_messages
from clutchest.signals import Signal
from clutchest.vehicle import Vehicle, load_vehicle

if TYPE_CHECKING:
    import can

TICK = 0.25  # s without a frame, after which the time that passes is told
GATHER = 0.05  # s for which frames are gathered, as long as no estimate is due
PROMPT = 0.008  # s before one is due, from which every frame is looked at at once
ON_ITS_WAY_NS = 1_000_000_000  # a frame may take this long from its stamp to here
KEPT_S = 600.0  # s for which frames are held, should a signal be heard for the first time
WATCH = 0.25  # s after which watchers look at what has come, as long as no estimate comes
SHOWN = 12  # events that a panel remembers


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened: ``time`` s from the drive's first frame, ``kind`` mode, engagement,
    fault, gap, reconnect or warning."""

    time: float
    kind: str
    name: str
    data: Mapping[str, Any] = field(default_factory=dict)


class Watcher(Protocol):
    """What looks at everything that a drive brings, and may have something to tell: fault tests."""

    def watch(
        self, signals: Mapping[str, Signal], frames: Frames, start_ns: int, now: float
    ) -> Iterable[Event]:
        """Events that new ``signals`` and ``frames`` give reason to; all up to ``now`` s have come.

        Times count from ``start_ns``, the stamp of the drive's first frame.  The first call of a
        drive brings all of its beginning.
        """
        ...

    def finish(self, now: float) -> Iterable[Event]:
        """Events that the whole drive gives reason to, which ends at ``now`` s; may take long."""
        ...

    def close(self) -> None:
        """The session ends."""
        ...


@dataclass
class Status:
    """How it goes: what a panel shows."""

    vehicle: str
    frames: int = 0
    lost: int = 0
    rows: int = 0
    now: float = 0.0
    piece: Piece | None = None
    events: deque[Event] = field(default_factory=lambda: deque(maxlen=SHOWN))
    warnings: tuple[str, ...] = ()
    away: str = ""
    silent_s: float = 0.0
    address: str = ""
    latency_s: deque[float] = field(default_factory=lambda: deque(maxlen=1000))


Show = Callable[[Status, Piece | None, Sequence[Event]], None]


class Monitor:
    """Watches a clutch over ``bus``, an open python-can bus; only mapped messages are let in.

    ``out`` is the folder for ``received.log``, ``estimates.parquet``, ``events.jsonl``,
    ``recording.rrd`` and ``state.json``; nothing is written without.  ``rate`` Hz of the estimates;
    ``state`` as an earlier run left it; ``serve`` the ports of a live viewer, which only this
    machine can reach; ``reopen`` makes a new bus when an interface is gone for good; ``watchers``
    are asked at every piece.  The estimates are those of a replay of ``received.log``.
    """

    def __init__(
        self,
        bus: can.BusABC,
        vehicle: Vehicle | str | Path,
        *,
        out: Path | None = None,
        rate: float = 10.0,
        state: Mapping[str, Any] | None = None,
        serve: tuple[int, int] | None = None,
        reopen: Callable[[], can.BusABC] | None = None,
        watchers: Sequence[Watcher] = (),
        progress: Progress | None = None,
    ) -> None:
        self.vehicle = load_vehicle(vehicle)
        self.database = load_database(self.vehicle)
        self.messages = [
            self.database.message(name) for name in mapped_messages(self.vehicle, self.database)
        ]
        bus.set_filters(filters(self.messages))  # type: ignore[arg-type]
        self._listener = Listener(bus, reopen)
        self._listener.start()
        ready(self.vehicle, progress)  # compiled before the first estimate is due
        self.rate, self.state, self.watchers = rate, state, tuple(watchers)
        self.status = Status(self.vehicle.name)
        self.final: Mapping[str, Any] | None = None
        self._stamps, self._silence = Stamps(), Silence(self.vehicle)
        self._session = None if out is None else Session(out, provenance(self.vehicle, ""))
        self._recording = None
        if self._session is not None:
            from clutchest.record.live_recording import LiveRecording

            self._recording = LiveRecording(self._session.recording, self.vehicle, serve)
            self.status.address = self._recording.address
        self._drive, self._offset, self._mode = 0, 0.0, ""
        self._start_ns: int | None = None
        self._last_ns = 0
        self._heard: list[Frames] = []
        self._unwatched: list[Frames] = []  # and _arrived: what no watcher has looked at yet
        self._arrived: dict[str, list[Signal]] = {}
        self._seen: dict[str, float] = {}  # up to when, s, each signal has arrived
        self._watched = 0.0
        self._counted: dict[str, Frames] = {}
        self._late_told = self.stopped = False
        self._new: list[Event] = []
        self._live = self._new_drive()

    def send(self, frames: Frames) -> None:
        """Put frames on the bus; while the interface is away they are lost, as any node's are."""
        self._listener.send(frames)

    def stop(self) -> None:
        """End :meth:`run` soon; safe from a signal handler and from other threads."""
        self.stopped = True

    def run(self, duration: float | None = None, show: Show | None = None) -> Status:
        """Watch for ``duration`` s, or until stopped.

        ``show`` is called with every piece, every event, and a few times a second in between.
        """
        end = None if duration is None else time.monotonic() + duration
        for note in self._session.notes if self._session else ():
            self._tell("warning", note)
        gc.freeze()  # what is there stays: nobody need look through it
        gc.disable()  # rubbish is cleared away when no row waits, see _after
        try:
            while not self.stopped and (end is None or time.monotonic() < end):
                frames = self._listen()
                piece = self._take(frames)
                self._after(frames, piece, show)
            self._listener.stop()
            frames = self._listen(0.0)
            self._after(frames, self._take(frames), show)
            with suppress(KeyboardInterrupt):  # of somebody who does not wait for the last look
                self._end_drive(show)
            if self._new and show is not None:
                show(self.status, None, self._new)
        finally:
            gc.enable()
            gc.unfreeze()
            self._close()
        return self.status

    def _listen(self, wait: float = TICK) -> Frames:
        """The frames that have come, with the stamps that are used, already on disk."""
        batches, heard = [], self._listener.heard
        try:
            item = heard.get(timeout=wait) if wait else heard.get_nowait()
            if wait:
                self._gather()
            while True:
                if isinstance(item, Trouble):
                    self._trouble(item)
                else:
                    batches.append(self._received(item))
                item = heard.get_nowait()
        except queue.Empty:
            pass
        frames = Frames.concatenate(batches)
        if self._session is not None:
            self._session.receive(frames)
        return frames

    def _gather(self) -> None:
        """Let frames come together while nothing is due: one batch costs what one frame does."""
        due = self._live.due_ns
        left = GATHER if due is None else (due - self._stamps.now(0)) / 1e9 - PROMPT
        if left > 0:
            time.sleep(min(left, GATHER))

    def _received(self, received: Received) -> Frames:
        frames = self._stamps.used(received)
        self.status.frames += len(frames)
        for jump in self._stamps.jumps:
            self._tell(
                "warning",
                f"the interface's clock jumped by {jump:+.1f} s; taken out",
                {"jump_s": jump},
            )
        self._stamps.jumps.clear()
        if (more := received.dropped - self.status.lost) > 0:
            self.status.lost = received.dropped
            self._tell(
                "gap", "bus", {"frames_dropped": more, "why": "the socket's buffer was full"}
            )
        return frames

    def _take(self, frames: Frames) -> Piece | None:
        """What has become certain by now."""
        if len(frames):
            if self._start_ns is not None and (
                frames.t_ns[0] - self._last_ns > HOLE_S * 1e9
            ):  # parked: the next drive begins as it would in a replay
                self._end_drive(None)
                self._live = self._new_drive()
            if self._start_ns is None:
                self._start_ns = int(frames.t_ns[0])
            self._last_ns = int(frames.t_ns[-1])
            now_ns = int(frames.t_ns[-1])
            self._keep(frames)
        elif self._start_ns is None:
            return None
        else:
            now_ns = self._stamps.promised(ON_ITS_WAY_NS)
        self.status.now = (now_ns - self._start_ns) / 1e9
        self.status.silent_s = (now_ns - self._last_ns) / 1e9
        piece = self._live.take(frames, now_ns)
        if self._live.late and not self._late_told:
            self._late_told = True
            self._tell(
                "warning",
                "a signal was heard for the first time so late that the estimates"
                " go on without it; a new start uses it",
            )
        return piece

    def _keep(self, frames: Frames) -> None:
        """Hold the beginning of a drive, in case that a mapped signal is still to come."""
        assert self._start_ns is not None
        if self._live.history is None:
            return
        if self._live.complete or frames.t_ns[-1] - self._start_ns > KEPT_S * 1e9:
            self._live.history = None
            self._heard.clear()
        else:
            self._heard.append(frames)

    def _new_drive(self) -> Live:
        if self._start_ns is not None:
            self.state = self.final
            self._offset += self.status.now
            self._drive += 1
            self._start_ns, self._mode, self._seen, self._watched = None, "", {}, 0.0
        self._heard, self._unwatched, self._arrived = [], [], {}
        return Live(
            self.vehicle,
            self.database,
            rate=self.rate,
            state=self.state,
            history=lambda: Frames.concatenate(self._heard),
        )

    def _after(self, frames: Frames, piece: Piece | None, show: Show | None) -> None:
        """Everything that follows from new frames and from what became certain: first of all what
        is shown, then what no estimate waits for, and is shown with the next one."""
        if piece is not None:
            self._told(piece)
            if len(piece.track.time):  # a stretch between two rows releases none
                self.status.latency_s.append((time.time_ns() - piece.released_ns) / 1e9)
        if show is not None:
            show(self.status, piece, self._new)
        self._new = []
        if len(frames):
            self._counters(frames)
        for since, name, data in self._silence.of(frames, piece, self.status.now):
            self._tell("gap", name, data, since)
        self._arrive(frames)
        # behind a row there is time until the next one
        if piece is not None or self.status.now - self._watched >= WATCH:
            self._watch()
        if piece is not None:
            self._record(piece)
        if piece is not None or not len(frames):
            gc.collect()

    def _arrive(self, frames: Frames) -> None:
        """Hold what has come until the watchers look at it."""
        self._unwatched.append(frames)
        for name, signal in self._live.arrived.items():
            until = self._seen.get(name, -np.inf)
            if len(signal) and signal.time[0] <= until:  # the estimates began anew, from the start
                signal = signal.take(signal.time > until)
            if len(signal):
                self._seen[name] = float(signal.time[-1])
                self._arrived.setdefault(name, []).append(signal)

    def _watch(self) -> None:
        """What the watchers make of new frames, as soon as it is known what they mean."""
        if not self._live.begun or self._start_ns is None:
            return
        frames, self._unwatched = Frames.concatenate(self._unwatched), []
        arrived, self._arrived = self._arrived, {}
        self._watched = now = self.status.now
        signals = {name: Signal.joined(parts) for name, parts in arrived.items()}
        for watcher in self.watchers:
            for event in watcher.watch(signals, frames, self._start_ns, now):
                self._put(event)

    def _told(self, piece: Piece) -> None:
        track = piece.track
        self.status.rows += len(track.time)
        if len(track.time):
            self.status.piece = piece
        if piece.begins:
            self.status.warnings = piece.warnings
            for warning in piece.warnings:
                self._tell("warning", warning)
        for at, code in zip(track.time, track.mode, strict=True):
            mode = track.mode_names[code]
            if mode != self._mode:
                self._tell("mode", mode, {"before": self._mode or None}, float(at))
                self._mode = mode
        for engagement in track.engagements:
            self._tell(
                "engagement", "slip", asdict(engagement), engagement.start_s + engagement.duration_s
            )
        if self._session is not None:
            self._session.keep(track, self._drive, piece.begins)

    def _record(self, piece: Piece) -> None:
        """Into the recording, which nobody waits for."""
        if self._recording is None:
            return
        if piece.begins and self._start_ns is not None and not self._drive:
            self._recording.begin(self._start_ns, provenance(self.vehicle, ""))
        self._recording.add(piece.track, piece.signals, self._offset)

    def _counters(self, frames: Frames) -> None:
        """Frames of checked messages that the sender counted and nobody received."""
        for message in self.messages:
            if message.name not in self.vehicle.checked:
                continue
            rows = np.flatnonzero(
                (frames.id & np.uint32(message.id_mask)) == (message.id & message.id_mask)
            )
            if not len(rows):
                continue
            new = frames.take(rows)
            before = self._counted.get(message.name)
            both = new if before is None else Frames.concatenate([before, new])
            self._counted[message.name] = new.take(np.array([-1]))
            if jumps := check(both, np.arange(len(both)), message).jumps:
                self._tell("gap", message.name, {"counter_jumps": jumps})

    def _trouble(self, trouble: Trouble) -> None:
        if trouble.back:
            self._tell("reconnect", "bus", {"after": self.status.away})
            self.status.away = ""
        else:
            self.status.away = trouble.what
            self._tell("warning", f"the interface failed: {trouble.what}")

    def _tell(
        self, kind: str, name: str, data: Mapping[str, Any] | None = None, at: float | None = None
    ) -> None:
        self._put(Event(self.status.now if at is None else at, kind, name, data or {}))

    def _put(self, event: Event) -> None:
        self._new.append(event)
        self.status.events.append(event)
        line = {**asdict(event), "drive": self._drive}
        if self._session is not None:
            self._session.tell(line)
        if self._recording is not None:
            self._recording.tell(line, self._offset)

    def _end_drive(self, show: Show | None) -> None:
        self._after(Frames.empty(), self._finish(), show)
        self._watch()
        for watcher in self.watchers if self._start_ns is not None else ():
            for event in watcher.finish(self.status.now):
                self._put(event)

    def _finish(self) -> Piece | None:
        """The last of a drive."""
        try:
            piece = self._live.finish()
        except ClutchestError as problem:  # a session that heard too little is none the less one
            self._tell("warning", str(problem))
            return None
        self.final = self._live.final()
        return piece

    def _close(self) -> None:
        for watcher in self.watchers:
            watcher.close()
        self._listener.stop()
        if self._recording is not None:
            self._recording.close()
        self.written = [] if self._session is None else self._session.close(self.final)
