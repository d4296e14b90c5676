"""The monitor: a bus in, estimates as soon as they are final, events, and the files of both."""

from __future__ import annotations

import gc
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import asdict, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

import can
from clutchest.can.frames import Frames
from clutchest.checked import checked
from clutchest.errors import ClutchestError
from clutchest.estimate.drive import Piece
from clutchest.estimate.live_tracking import LiveTracking
from clutchest.estimate.run import TrackingFigures
from clutchest.monitor.events import MonitorEvent, SessionStatus, Show, Watcher
from clutchest.monitor.live import LiveEstimator, compile_live
from clutchest.monitor.outputs import Outputs
from clutchest.monitor.reception import CounterCheck, Reception
from clutchest.monitor.settings import MonitorSettings
from clutchest.monitor.silence import Silence
from clutchest.reading.log import SPLIT_S, load_database
from clutchest.reading.wanted import mapped_messages
from clutchest.signals import Signal
from clutchest.vehicle import Vehicle, load_vehicle

__all__ = ["Monitor", "MonitorEvent", "MonitorSettings", "SessionStatus", "Watcher"]

TICK_S = 0.25  # s without a frame, after which the time itself is processed
KEPT_S = 600.0  # s for which frames are held, for a signal that is first received late
WATCH_S = 0.25  # s between two calls of the watchers, as long as there are no estimates


class Monitor:
    """Estimates a machine's states over ``bus``, an open python-can bus, while it runs.

    ``settings``, or their fields by keyword: :class:`~clutchest.monitor.settings.MonitorSettings`.
    Only mapped messages are received.  The estimates equal those of a replay of ``received.log``.
    ``final`` is the state after the latest drive, ``written`` the files of a finished session.
    """

    @checked
    def __init__(
        self,
        bus: can.BusABC,
        vehicle: Vehicle | str | Path,
        settings: MonitorSettings | None = None,
        **options: Any,
    ) -> None:
        self.settings = replace(MonitorSettings() if settings is None else settings, **options)
        self.vehicle = load_vehicle(vehicle)
        self.database = load_database(self.vehicle)
        names = mapped_messages(self.vehicle, self.database)
        self.messages = [self.database.message(name) for name in names]
        self.status = SessionStatus(self.vehicle.name)
        self.stopped = False
        self.analysing = False  # in the end, which an interrupt may cut short
        self.final: Mapping[str, Any] | None = None
        self.written: list[str] = []
        self._watchers = tuple(self.settings.watchers)
        self._drive, self._offset, self._mode = 0, 0.0, ""
        self._start_ns: int | None = None
        self._last_ns, self._late_reported = 0, False
        self._new: list[MonitorEvent] = []
        self._unseen: OSError | None = None  # why nothing can be shown any more
        self._reception = Reception(bus, self.messages, self.settings.reopen, self._report)
        compile_live(self.vehicle, self.settings.progress)  # before the first estimate is due
        self._outputs = Outputs(self.settings.out, self.vehicle, self.settings.serve)
        self.status.address = self._outputs.address
        self._silence = Silence(self.vehicle)
        checked = [m for m in self.messages if m.name in self.vehicle.checked]
        self._counters = CounterCheck(checked)
        self._begin_drive(self.settings.state)

    @checked
    def add_watcher(self, watcher: Watcher) -> None:
        """Let one more watcher receive all data from now on."""
        self._watchers += (watcher,)

    @checked
    def send(self, frames: Frames) -> None:
        """Put frames on the bus; while the interface is down they are lost."""
        self._reception.send(frames)

    def stop(self) -> None:
        """End :meth:`run` soon; safe from a signal handler and from other threads."""
        self.stopped = True

    @checked
    def run(self, duration: float | None = None, show: Show | None = None) -> SessionStatus:
        """Monitor for ``duration`` s, or until stopped.

        ``show`` is called with every piece, every event, and a few times a second in between; where
        it raises OSError, as an output does that nobody reads any more, the session ends.  Raises
        ClutchestError where a thread, a process or a file of the session fails; what was received
        and estimated before is in the files then.
        """
        end = None if duration is None else time.monotonic() + duration
        for note in (*self.vehicle.notes, *self._outputs.notes):
            self._report("warning", note, {})
        gc.freeze()  # objects of the set-up are not collected
        gc.disable()  # garbage is collected when no row is due, see _process
        try:
            while not self.stopped and (end is None or time.monotonic() < end):
                self._take(self._receive(TICK_S), show)
            self._reception.stop()
            while len(frames := self._receive(0.0)):
                self._take(frames, show)
            self._take(frames, show)
            self._end_drive(show)
            self._show(show, None)
        except BaseException:
            with suppress(ClutchestError, OSError):  # the first one says why
                self._close()
            raise
        finally:
            gc.enable()
            gc.unfreeze()
        self._close()
        if self._unseen is not None:
            raise ClutchestError(
                f"the output cannot be written any more: {self._unseen.strerror}; the session has "
                "ended, its files are complete"
            )
        return self.status

    def _receive(self, wait: float) -> Frames:
        """The frames received meanwhile, already on disk."""
        frames = self._reception.take(wait, self._live.due_ns)
        self.status.frames, self.status.lost = self._reception.count, self._reception.lost
        self.status.away = self._reception.away
        self.status.losses_known = self._reception.losses_known
        self.status.malformed = sum(self._reception.malformed.values())
        self._outputs.receive(frames)
        return frames

    def _take(self, frames: Frames, show: Show | None) -> None:
        """Estimate over new frames, which a process that was stopped may have of two drives."""
        parked = np.flatnonzero(np.diff(frames.t_ns) > SPLIT_S * 1e9) + 1
        for a, b in pairwise((0, *parked.tolist(), len(frames))):
            part = frames.take(np.arange(a, b)) if len(parked) else frames
            self._process(part, self._estimate(part), show)

    # --- drives -----------------------------------------------------------------------------------

    def _begin_drive(self, state: Mapping[str, Any] | None) -> None:
        self._history: list[Frames] = []  # frames so far, as long as a signal may still be new
        self._frames: list[Frames] = []  # not yet given to the watchers, and …
        self._signals: dict[str, list[Signal]] = {}
        self._last_s: dict[str, float] = {}  # signal → time of its last sample
        self._start_ns, self._mode = None, ""
        self._watched_s, self._contradiction = 0.0, ""
        self._tracking = LiveTracking(self.vehicle)
        self._live = LiveEstimator(
            self.vehicle,
            self.database,
            rate=self.settings.rate,
            state=state,
            history=lambda: Frames.concatenate(self._history),
        )

    def _end_drive(self, show: Show | None) -> None:
        self._process(Frames.empty(), self._finish(), show)
        self._followed(self._tracking.finish())
        self._watch()
        with suppress(KeyboardInterrupt):
            self.analysing = True
            for watcher in self._watchers if self._start_ns is not None else ():
                for event in watcher.finish(self.status.now):
                    self._put(event)
            self.analysing = False

    def _finish(self) -> Piece | None:
        """The last rows of a drive."""
        try:
            piece = self._live.finish()
        except ClutchestError as problem:  # a session without estimates is still a session
            self._report("warning", str(problem), {})
            return None
        self.final = self._live.final()
        return piece

    def _estimate(self, frames: Frames) -> Piece | None:
        """The rows that have become final."""
        if len(frames):
            if self._start_ns is not None and frames.t_ns[0] - self._last_ns > SPLIT_S * 1e9:
                self._end_drive(None)  # parked: the next drive begins as it would in a replay
                self._offset += self.status.now
                self._drive += 1
                self._begin_drive(self.final)
            if self._start_ns is None:
                self._start_ns = int(frames.t_ns[0])
            self._last_ns = now_ns = int(frames.t_ns[-1])
            self._hold(frames, self._start_ns)
        elif self._start_ns is None:
            return None
        else:
            now_ns = self._reception.horizon_ns()
        self.status.now = (now_ns - self._start_ns) / 1e9
        self.status.silent_s = (now_ns - self._last_ns) / 1e9
        piece = self._live.take(frames, now_ns)
        if self._live.late and not self._late_reported:
            self._late_reported = True
            words = (
                "a signal was received for the first time so late that the estimates go on"
                " without it; a new start uses it"
            )
            self._report("warning", words, {})
        return piece

    def _hold(self, frames: Frames, start_ns: int) -> None:
        """Hold the frames of a drive's start, for a mapped signal that is first received later."""
        if self._live.history is None:
            return
        if self._live.complete or frames.t_ns[-1] - start_ns > KEPT_S * 1e9:
            self._live.history = None
            self._history.clear()
        else:
            self._history.append(frames)

    # --- results ----------------------------------------------------------------------------------

    def _process(self, frames: Frames, piece: Piece | None, show: Show | None) -> None:
        """Show and write what is new: rows first, then everything that no row waits for, which is
        shown with the next one."""
        if piece is not None:
            self._rows(piece)
            if len(piece.track.time):  # a stretch between two rows releases none
                self.status.latency_s.append((time.time_ns() - piece.released_ns) / 1e9)
        self._show(show, piece)
        if len(frames):
            for name, jumps in self._counters.jumps(frames).items():
                self._report("gap", name, {"counter_jumps": jumps})
        for since, name, data in self._silence.of(frames, piece, self.status.now):
            self._put(MonitorEvent(since, "gap", name, data))
        self._collect(frames)
        # after a row there is time until the next one
        if piece is not None or self.status.now - self._watched_s >= WATCH_S:
            self._watch()
        if piece is not None:
            first = piece.begins and not self._drive
            self._outputs.record(piece, self._start_ns if first else None, self._offset)
        if piece is not None or not len(frames):
            gc.collect()

    def _show(self, show: Show | None, piece: Piece | None) -> None:
        """Show what is new."""
        if show is not None and self._unseen is None:
            try:
                show(self.status, piece, self._new)
            except OSError as problem:
                self._unseen = problem
                self.stop()
        self._new = []

    def _rows(self, piece: Piece) -> None:
        """Rows into the status, the files and events of their own."""
        track = piece.track
        self.status.rows += len(track.time)
        if (found := track.contradiction) and found.words != self._contradiction:
            self._contradiction = found.words
            words = f"signals and model contradict each other: {found.words}"
            words += f"; {found.explanation}" if found.explanation else ""
            self._put(MonitorEvent(found.since_s, "warning", words, {}))
        if len(track.time):
            self.status.piece = piece
        if piece.begins:
            self.status.warnings = piece.warnings
            for warning in piece.warnings:
                self._report("warning", warning, {})
        for at, code in zip(track.time, track.mode, strict=True):
            mode = track.mode_names[code]
            if mode != self._mode:
                self._put(MonitorEvent(float(at), "mode", mode, {"before": self._mode or None}))
                self._mode = mode
        for engagement in track.engagements:
            end = engagement.start_s + engagement.duration_s
            self._put(MonitorEvent(end, "engagement", "slip", asdict(engagement)))
        self._followed(self._tracking.take(piece))
        self._outputs.keep(piece, self._drive, self._start_ns)

    def _followed(self, actuations: Sequence[TrackingFigures]) -> None:
        """How the output followed actuations that are over."""
        unit = tracking.unit if (tracking := self.vehicle.machine.tracking) else ""
        for response in actuations:
            figures = response.figures(unit)
            self._put(MonitorEvent(response.end_s, "tracking", "actuation", figures))

    def _collect(self, frames: Frames) -> None:
        """Hold new frames and samples for the watchers."""
        self._frames.append(frames)
        for name, signal in self._live.new_signals.items():
            last = self._last_s.get(name, -np.inf)
            if len(signal) and signal.time[0] <= last:  # the estimates were restarted
                signal = signal.take(signal.time > last)
            if len(signal):
                self._last_s[name] = float(signal.time[-1])
                self._signals.setdefault(name, []).append(signal)

    def _watch(self) -> None:
        """Give new frames and samples to the watchers, once the drive has begun."""
        if not self._live.begun or self._start_ns is None:
            return
        frames, self._frames = Frames.concatenate(self._frames), []
        signals = {name: Signal.joined(parts) for name, parts in self._signals.items()}
        self._signals = {}
        self._watched_s = self.status.now
        for watcher in self._watchers:
            for event in watcher.watch(signals, frames, self._start_ns, self.status.now):
                self._put(event)

    def _report(self, kind: str, name: str, data: Mapping[str, Any]) -> None:
        self._put(MonitorEvent(self.status.now, kind, name, data))

    def _put(self, event: MonitorEvent) -> None:
        self._new.append(event)
        self.status.events.append(event)
        self._outputs.event({**asdict(event), "drive": self._drive}, self._offset)

    def _close(self) -> None:
        with ExitStack() as ends:  # each of them, whatever becomes of the others
            ends.callback(self._complete)
            ends.callback(self._reception.stop)
            for watcher in self._watchers:
                ends.callback(watcher.close)

    def _complete(self) -> None:
        """The state goes with the rows that were written, also where the drive was cut short."""
        self.final = self._live.final() or self.final
        self.written = self._outputs.close(self.final)
