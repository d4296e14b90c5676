"""A drive that is going on: the estimates of a replay, as soon as nothing can change them any more.

Frames go in as they come.  The same decoding, timeline and compiled filter as in a replay work on
the last seconds only; an event is filtered once the look-ahead of everything that judges it is
filled: samples that inputs run straight to, the modes' guards, averages at rest, inferred gears.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from clutchest.can.database import Database
from clutchest.can.frames import Frames
from clutchest.estimate.habits import Habit
from clutchest.estimate.modes import Mode, Thresholds
from clutchest.estimate.replay import left_out
from clutchest.estimate.run import Engagement, Track
from clutchest.estimate.samples import APART, Told, slope_count
from clutchest.estimate.start import History, carried_on, fresh, leave
from clutchest.estimate.timeline import (
    Assembled,
    Setting,
    Stretch,
    Timeline,
    assemble,
    held_on,
)
from clutchest.estimate.track import Rows, engagements, track_of
from clutchest.estimate.whole_log import (
    Belief,
    Compiled,
    Filtered,
    Progress,
    compile_model,
    delays,
    run,
)
from clutchest.models import model_for
from clutchest.reading.incoming import Decoded, Incoming
from clutchest.signals import HEAD, LOST, Floats, Signal
from clutchest.vehicle import Vehicle

MARGIN = 1.0  # s more of the past than anything looks back
ASK = 0.25  # s between two looks at whether a drive has begun


@dataclass(frozen=True, slots=True)
class Piece:
    """What became certain: a ``track`` of the rows behind those of the piece before, and what the
    filter made of them.

    A piece that ``begins`` replaces everything so far.  ``released_ns`` is when the frame came that
    made its last row certain, as far as its look-ahead tells.
    """

    track: Track
    timeline: Timeline
    filtered: Filtered
    signals: Mapping[str, Signal]
    begins: bool
    released_ns: int
    warnings: tuple[str, ...] = ()


def ready(vehicle: Vehicle, progress: Progress | None = None) -> None:
    """Compile what a live drive with all mapped signals will need."""
    compile_model(vehicle, model_for(vehicle.model, set(vehicle.signals)), progress=progress)


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
        self._drive: _Drive | None = None
        self.arrived: Mapping[str, Signal] = {}  # the samples that the last frames brought

    @property
    def begun(self) -> bool:
        """Whether it is known what can be estimated, and estimates come."""
        return self._drive is not None

    @property
    def due_ns(self) -> int | None:
        """When the next row may become certain; None while nobody can say."""
        if self._drive is None:
            return None
        return self._drive.incoming.start_ns + round(self._drive.due_s * 1e9)

    @property
    def complete(self) -> bool:
        """Whether nothing mapped is left to be heard for the first time."""
        return self._drive is not None and self._drive.incoming.complete

    @property
    def late(self) -> bool:
        """Whether something was heard for the first time that the estimates do not use."""
        return self._drive is not None and self._drive.incoming.late

    def take(self, frames: Frames, now_ns: int) -> Piece | None:
        """What ``frames`` make certain; all up to ``now_ns`` have come, on their clock."""
        self._now_ns = now_ns
        if len(frames):
            self._last_ns = int(frames.t_ns[-1])
        if self._drive is None:
            if len(frames):
                self._waiting.append(frames)
            return self._begin(now_ns)
        incoming = self._drive.incoming
        new = incoming.take(frames, now_ns)
        self.arrived = new.signals
        piece = self._drive.take(new)
        if incoming.late and self.history is not None:
            self._drive, self._waiting = None, [self.history()]
            return self._begin(now_ns) or piece
        return piece

    def finish(self) -> Piece | None:
        """The rest, up to the last frame, or as far as a silence behind it has been told of.

        Raises ClutchestError if a signal that the model needs never came.
        """
        if self._drive is None:
            if not self._waiting:
                return None
            return self._started(Frames.concatenate(self._waiting), last=True)
        incoming = self._drive.incoming
        silent = self._drive.done > (self._last_ns - incoming.start_ns) / 1e9
        upto = self._now_ns if silent else self._last_ns
        rest = incoming.take(Frames.empty(), upto, last=True)
        self.arrived = rest.signals
        return self._drive.take(rest, last=True)

    def final(self) -> dict[str, Any] | None:
        """What the next drive needs, as ``state.json`` holds it; None before the first estimate."""
        return None if self._drive is None else self._drive.final()

    def _begin(self, now_ns: int) -> Piece | None:
        """Begin once every mapped signal has been heard for ``HEAD`` s, or waiting is no use."""
        if not self._waiting or now_ns - self._asked_ns < ASK * 1e9:
            return None
        self._asked_ns = now_ns
        frames = Frames.concatenate(self._waiting)
        self._waiting = [frames]
        incoming = Incoming(self.vehicle, self.database, frames)
        heard, settled = incoming.heard_s, incoming.first.settled
        model = model_for(self.vehicle.model, set(heard))
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
        self._drive = _Drive(self.vehicle, incoming, self.rate, self.state)
        self._waiting = []
        first = incoming.first
        self.arrived = first.signals
        if last:
            rest = incoming.take(Frames.empty(), int(frames.t_ns[-1]), last=True)
            first = Decoded({n: s.then(rest.signals[n]) if n in rest.signals else s
                             for n, s in first.signals.items()}, rest.settled)  # fmt: skip
        return self._drive.take(first, last)


class _Drive:
    """The filter of one drive, and the last seconds of its signals."""

    def __init__(
        self, vehicle: Vehicle, incoming: Incoming, rate: float, state: Mapping[str, Any] | None
    ) -> None:
        self.vehicle, self.incoming, self.state = vehicle, incoming, state
        model = model_for(vehicle.model, set(incoming.heard_s))
        self.compiled: Compiled = compile_model(vehicle, model)
        self.setting = Setting(vehicle, self.compiled.model, rate, delays(vehicle))
        self.thresholds = Thresholds.of(vehicle.modes)
        self.samples: dict[str, Signal] = {}
        self.unseen: dict[str, Signal] = {}  # since the last piece
        self.lags: dict[str, int] = {}  # how many samples beyond must come
        self.times: dict[str, Floats] = {}  # when they came
        self.worth = -np.inf  # s; before, nothing new is certain
        self.habits: dict[str, Habit] = {}
        self.belief: Belief | None = None
        self.gained = np.zeros((2, len(self.compiled.model.states)))
        self.begin = 0.0  # s, of the estimates
        self.done = -np.inf  # events before are filtered
        self.averaged: dict[int, float] = {}
        self.recent: Rows | None = None  # since the last slip event ended
        self.history = History.of(state)
        self.last: Timeline | None = None
        longest = max(s.repeats for s in model.sensors)
        self.back = self.thresholds.back + 2 * longest + MARGIN

    def take(self, new: Decoded, last: bool = False) -> Piece | None:
        """Filter what ``new`` makes certain, everything where it is the ``last``."""
        begins = not self.samples
        for name, signal in new.signals.items():
            valid = signal.only_valid()
            if name in self.samples:
                self.samples[name] = self.samples[name].then(valid)
            elif begins and len(valid):
                self.samples[name], self.habits[name] = valid, Habit.of(valid)
            self.unseen[name] = self.unseen[name].then(signal) if name in self.unseen else signal
        if not last and not self._may_tell(new.settled):
            return None
        present, known = self._present(new.settled, last)
        if not last and known - self.thresholds.ahead < self.worth:
            return None
        end = max(new.settled.values())
        if last:
            end = max(end, float(present[self.setting.model.anchor].time[-1]))
        if self.belief is None:
            self.begin = max(0.0, min(float(s.time[0]) for s in present.values()))
        since = max(self.begin, self.done - self.back)
        found = assemble(self.setting, present, self.habits,
                         Stretch(since, end, self.averaged))  # fmt: skip
        before = self._certain(found, known, last)
        line = _cut(found.line, self.done, before)
        if line is None:
            return None
        signals, self.unseen = self.unseen, {}
        piece = self._filter(found, line, signals, last)
        self.done = before
        self._forget()
        return piece

    def _may_tell(self, settled: Mapping[str, float]) -> bool:
        """Whether enough samples have come for a new row, were all of them good: quick to say."""
        for name, lag in self.lags.items():
            time, late = self.samples[name].time, self.setting.late(name)
            enough = len(time) > lag and time[-1 - lag] - late - self.thresholds.ahead >= self.worth
            if not enough and settled[name] - time[-1] <= LOST:
                return False
        return True

    @property
    def due_s(self) -> float:
        """When the next row may become certain, s on the drive's clock, if nothing is late."""
        return self.worth + self.thresholds.ahead + max(
            (lag * self.habits[name].period + self.setting.late(name)
             for name, lag in self.lags.items()), default=0.0,
        )  # fmt: skip

    def _present(self, settled: Mapping[str, float], last: bool) -> tuple[dict[str, Signal], float]:
        """The signals at hand, cleaned, and up to when, s, what drives the equations is known.

        A signal that has been silent for so long that it counts as lost holds its last value.
        """
        model, present = self.setting.model, {}
        late = {name: self.setting.late(name) for name in self.samples}
        known = min(settled.values()) - max(late.values())
        sources = {of: slope_count(self.habits[of].period) for of in model.slopes.values()}
        needed = self.setting.needed(self.samples)
        self.lags, self.times = {}, {}
        for name, signal in self.samples.items():
            present[name], _ = self.setting.cleaned(name, signal, self.habits[name])
            if name not in needed:
                continue
            upto, time = settled[name] - late[name], present[name].time
            present[name] = held_on(present[name], upto)
            if last or len(present[name]) > len(time):
                known = min(known, upto)
                continue
            # the last sample may turn out a spike; a slope needs half its window beyond
            lag = sources[name] // 2 + 2 if name in sources else 1
            self.lags[name], self.times[name] = lag, time + late[name]
            sure = time[-1 - lag] if len(time) > lag else time[0]
            if name in sources:
                begin = _last_begin(time, self.thresholds.gap)
                if begin > 0 and len(time) - begin < sources[name] + 2:
                    sure = time[begin - 1]
            known = min(known, float(sure))
        return present, known

    def _certain(self, found: Assembled, known: float, last: bool) -> float:
        """Events before this time, s, are final."""
        if last:
            return np.inf
        stamps = found.stamps
        place = np.searchsorted(stamps, known - self.thresholds.ahead, side="right") - 1
        if place < 0:
            return self.done
        judged = float(stamps[place])
        before = float(np.nextafter(judged, np.inf))
        closed = {}
        for i, told in found.averages.items():
            name = self.setting.model.sensors[i].column or self.setting.model.sensors[i].name
            apart = APART * max(self.habits[name].period, 1e-3)
            closed[i] = (told.full & (told.last <= judged)) | (judged - told.last > apart)
            before = min(before, *told.first[~closed[i]], before)
        before = max(before, self.done)
        rate = self.setting.rate
        self.worth = (np.floor(before * rate) + 1) / rate
        for i, told in found.averages.items():
            open_ = told.first[~closed[i] | (told.time >= before)]
            self.averaged[i] = float(np.nextafter(self._anew(told, open_, before), -np.inf))
            if len(open_) and open_[0] <= before:  # nothing before the whole of it is there
                repeats = self.setting.model.sensors[i].repeats
                self.worth = max(self.worth, float(open_[0]) + 2 * repeats)
        return before

    def _anew(self, told: Told, open_: Floats, before: float) -> float:
        """From where readings are averaged again, s: from the first average that is still open, or
        from the one before it, which may be the last event that has been filtered."""
        first = float(min(open_.min(initial=before), before))
        taken = told.first[(told.first < first) & (told.first >= before - self.back)]
        return float(taken.max(initial=-np.inf)) if len(taken) else first

    def _released_ns(self, row: float, found: Assembled) -> int:
        """When the frame came by which a row at this time, s, is certain."""
        for told in found.averages.values():
            within = (told.first <= row) & (row <= told.last)
            row = max(row, *told.last[within], row)
        until, moments = row + self.thresholds.ahead, [row]
        for name, time in self.times.items():
            place = int(np.searchsorted(time, until + self.setting.late(name))) + self.lags[name]
            if place < len(time):
                moments.append(float(time[place]))
        return self.incoming.start_ns + round(max(moments) * 1e9)

    def _filter(
        self, found: Assembled, line: Timeline, signals: Mapping[str, Signal], last: bool
    ) -> Piece:
        begins, warnings = self.belief is None, []
        if self.belief is None:
            start_ns = self.incoming.start_ns
            if self.state is None:
                self.belief = fresh(self.vehicle, self.compiled, found.line)
            else:
                self.belief, warning = carried_on(self.vehicle, self.compiled, found.line,
                                                  self.state, start_ns)  # fmt: skip
                warnings += [warning] if warning else []
            warnings += left_out(self.vehicle, self.compiled)
            self.start = self.belief.copy()
            self.first_s = float(line.t[0])
        filtered = run(self.compiled, line, self.belief, consider=True, gained=self.gained)
        self.belief, self.last = filtered.final, line
        rows = Rows.of(self.compiled, line, filtered)
        events = self._slips(rows, last)
        track = track_of(self.vehicle, self.compiled, line, filtered, rows, events)
        released = self._released_ns(float(line.t[-1]), found)
        return Piece(track, line, filtered, signals, begins, released, tuple(warnings))

    def _slips(self, rows: Rows, last: bool) -> tuple[Engagement, ...]:
        """The slip events that are over."""
        recent = rows if self.recent is None else self.recent.then(rows)
        away = np.flatnonzero(recent.mode != Mode.slipping)
        if last:
            over, keep = recent, len(recent.time)
        elif len(away):
            over, keep = recent.since(0), int(away[-1])
            over = Rows(*(getattr(over, name)[: keep + 1] for name in Rows.__slots__))
        else:
            self.recent = recent
            return ()
        self.recent = recent.since(keep)
        events = engagements(self.compiled, over)
        self.history = replace(self.history, engagements=self.history.engagements + len(events))
        return events

    def _forget(self) -> None:
        since = self.done - self.back
        longest = max((slope_count(self.habits[of].period)
                       for of in self.setting.model.slopes.values()), default=1)  # fmt: skip
        for name, signal in self.samples.items():
            late = self.setting.late(name)
            first = int(np.searchsorted(signal.time, since + late)) - longest - 2
            if first > 0:
                self.samples[name] = signal.take(slice(first, None))

    def final(self) -> dict[str, Any] | None:
        """As :func:`clutchest.estimate.start.leave` has it."""
        if self.belief is None or self.last is None:
            return None
        history = History.of(self.state).after(
            float(self.last.t[-1]) - self.first_s,
            self.history.engagements - History.of(self.state).engagements,
            max(float(self.belief.E[0] - self.start.E[0]), 0.0),
        )
        return leave(self.vehicle, self.compiled, self.last, self.belief,
                     self.incoming.start_ns, history)  # fmt: skip


def _last_begin(time: np.ndarray, gap: float) -> int:
    """The first sample behind the last hole of more than ``gap`` s."""
    holes = np.flatnonzero(np.diff(time) > gap)
    return int(holes[-1]) + 1 if len(holes) else 0


def _cut(line: Timeline, since: float, before: float) -> Timeline | None:
    """The events from ``since`` up to ``before`` s, led by the last one before them, which has been
    taken already; None if there are none."""
    a, b = np.searchsorted(line.t, [since, before])
    if a == b:
        return None
    lead = max(int(a) - 1, 0)
    events = slice(lead, int(b))
    sensor, emit = line.sensor[events].copy(), line.emit[events].copy()
    sensor[: a - lead] = emit[: a - lead] = -1
    rows = emit >= 0
    grid = line.grid[emit[rows]]
    emit[rows] = np.arange(np.count_nonzero(rows))
    return replace(
        line, t=line.t[events], sensor=sensor, z=line.z[events], R=line.R[events],
        u=line.u[events], row=line.row[events], mode=line.mode[events], emit=emit, grid=grid,
    )  # fmt: skip
