"""The filter of one drive, stretch by stretch: of what has come so far, all that is certain.

The decoding, timeline and compiled filter of a whole log work on the last seconds only; an event is
filtered once the look-ahead of everything that judges it is filled: samples that inputs run
straight to, the modes' guards, averages at rest.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from clutchest.compute.records import Belief
from clutchest.estimate.consistency import Consistency
from clutchest.estimate.delay_equalisation import Clocks
from clutchest.estimate.drive_setup import DriveSetup, held_on
from clutchest.estimate.engines import KERNEL, filter_of
from clutchest.estimate.initial_state import History, carried_on, contradicted, fresh, leave
from clutchest.estimate.run import Track
from clutchest.estimate.sample_timing import SampleTiming
from clutchest.estimate.samples import APART, SensorReadings, slope_count
from clutchest.estimate.timeline import (
    Assembled,
    Interval,
    Timeline,
    assemble,
)
from clutchest.estimate.track import NO_SLIPS, Rows, Slips, engagements, track_of
from clutchest.estimate.whole_log import (
    Compiled,
    Filtered,
    compile_model,
    copied,
    delays,
)
from clutchest.progress import Progress
from clutchest.signals import LOST, Floats, Signal
from clutchest.vehicle import Vehicle

MARGIN = 1.0  # s more of the past than anything needs


@dataclass(frozen=True, slots=True)
class Stretch:
    """What became certain, not filtered yet: the events of ``line``, ``signals`` their new samples;
    ``released_ns`` as :class:`Piece` has it."""

    assembled: Assembled
    line: Timeline
    signals: Mapping[str, Signal]
    last: bool
    released_ns: int


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


class Drive:
    """The filter of one drive, and the last seconds of its signals.

    ``names`` of the signals that it has, each with a sample in what comes first; t = 0 is at
    ``start_ns``, where a clock tells it; ``rate`` Hz of the output grid; ``state`` as an earlier
    run left it; ``engine``: the filter, one of ``ENGINES``.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        names: Iterable[str],
        start_ns: int | None,
        rate: float,
        state: Mapping[str, Any] | None,
        progress: Progress | None = None,
        engine: str = KERNEL,
    ) -> None:
        self.vehicle, self.start_ns, self.state = vehicle, start_ns, state
        self.filter = filter_of(engine)
        model = vehicle.machine.equations(set(names))
        self.compiled: Compiled = compile_model(vehicle, model, progress=progress)
        self.setting = DriveSetup(vehicle, self.compiled.model, rate, delays(vehicle))
        self.thresholds = self.setting.thresholds
        rules = vehicle.machine.regimes
        self._event = rules.modes.index(rules.event) if rules.event else -1
        self.clocks = Clocks(vehicle)
        self.samples: dict[str, Signal] = {}
        self.unseen: dict[str, list[Signal]] = {}  # since the last piece
        self.lags: dict[str, int] = {}  # how many samples beyond must come
        self.times: dict[str, Floats] = {}  # when they came
        self.worth = -np.inf  # s; before, nothing new is certain
        self.timings: dict[str, SampleTiming] = {}
        self.belief: Belief | None = None
        self.gained = np.zeros((2, len(self.compiled.model.states)))
        self.gained_before: Floats | float = 0.0  # information up to the last row
        self.own = np.zeros(len(self.compiled.model.states))  # its variance but for the parameters'
        self.begin = 0.0  # s, of the estimates
        self.done = -np.inf  # events before are filtered
        self.averaged: dict[int, float] = {}
        self.recent: Rows | None = None  # since the last slip event ended
        self.history = History.of(state)
        self.last: Timeline | None = None
        self.consistency = Consistency.of(self.compiled.model, vehicle)
        longest = max(s.repeats for s in model.sensors)
        self.back = self.thresholds.back + 2 * longest + MARGIN

    def take(
        self, new: Mapping[str, Signal], settled: Mapping[str, float], last: bool = False
    ) -> Piece | None:
        """Filter what ``new`` samples make certain, everything where they are the ``last``; each
        signal is complete up to when it is ``settled``, s."""
        stretch = self.ready(new, settled, last)
        return None if stretch is None else self.filtered(stretch)

    def ready(
        self, new: Mapping[str, Signal], settled: Mapping[str, float], last: bool = False
    ) -> Stretch | None:
        """What :meth:`take` filters.  It needs nothing that the filter makes, so that a stretch can
        be made ready while the one before it is filtered."""
        begins = not self.samples
        even = self.clocks.take(new)
        for name, signal in new.items():
            valid = even[name].only_valid()
            if name in self.samples:
                self.samples[name] = self.samples[name].then(valid)
            elif begins and len(valid):
                self.samples[name], self.timings[name] = valid, SampleTiming.of(valid)
            self.unseen.setdefault(name, []).append(signal)
        if not last and not self._may_tell(settled):
            return None
        present, known = self._present(settled, last)
        if not last and known - self.thresholds.ahead < self.worth:
            return None
        end = max(settled.values())
        if last:
            end = max(end, float(present[self.setting.model.anchor].time[-1]))
        if self.done == -np.inf:
            self.begin = max(0.0, min(float(s.time[0]) for s in present.values()))
        since = max(self.begin, self.done - self.back)
        assembled = assemble(
            self.setting, present, self.timings, Interval(since, end, self.averaged)
        )
        before = self._certain(assembled, known, last)
        line = _cut(assembled.line, self.done, before)
        if line is None:
            return None
        signals = {name: Signal.joined(parts) for name, parts in self.unseen.items()}
        self.unseen = {}
        released = self._released_ns(float(line.t[-1]), assembled)
        self.done = before
        self._forget()
        return Stretch(assembled, line, signals, last, released)

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
        return (
            self.worth
            + self.thresholds.ahead
            + max(
                (
                    lag * self.timings[name].period + self.setting.late(name)
                    for name, lag in self.lags.items()
                ),
                default=0.0,
            )
        )

    def _present(self, settled: Mapping[str, float], last: bool) -> tuple[dict[str, Signal], float]:
        """The signals at hand, cleaned, and up to when, s, what drives the equations is known.

        A signal that has been silent for so long that it counts as lost holds its last value.
        """
        model, present = self.setting.model, {}
        late = {name: self.setting.late(name) for name in self.samples}
        known = min(settled.values()) - max(late.values())
        sources = {of: slope_count(self.timings[of].period) for of in model.slopes.values()}
        needed = self.setting.needed(self.samples)
        self.lags, self.times = {}, {}
        for name, signal in self.samples.items():
            present[name], _ = self.setting.cleaned(name, signal, self.timings[name])
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

    def _certain(self, assembled: Assembled, known: float, last: bool) -> float:
        """Events before this time, s, are final."""
        if last:
            return np.inf
        stamps = assembled.stamps
        place = np.searchsorted(stamps, known - self.thresholds.ahead, side="right") - 1
        if place < 0:
            return self.done
        judged = float(stamps[place])
        before = float(np.nextafter(judged, np.inf))
        closed = {}
        for i, readings in assembled.averages.items():
            name = self.setting.model.sensors[i].column or self.setting.model.sensors[i].name
            apart = APART * max(self.timings[name].period, 1e-3)
            closed[i] = (readings.full & (readings.last <= judged)) | (
                judged - readings.last > apart
            )
            before = min(before, *readings.first[~closed[i]], before)
        before = max(before, self.done)
        rate = self.setting.rate
        self.worth = (np.floor(before * rate) + 1) / rate
        for i, readings in assembled.averages.items():
            open_ = readings.first[~closed[i] | (readings.time >= before)]
            self.averaged[i] = float(np.nextafter(self._anew(readings, open_, before), -np.inf))
            if len(open_) and open_[0] <= before:  # nothing before the whole of it is there
                repeats = self.setting.model.sensors[i].repeats
                self.worth = max(self.worth, float(open_[0]) + 2 * repeats)
        return before

    def _anew(self, readings: SensorReadings, open_: Floats, before: float) -> float:
        """From where readings are averaged again, s: from the first average that is still open, or
        from the one before it, which may be the last event that has been filtered."""
        first = float(min(open_.min(initial=before), before))
        taken = readings.first[(readings.first < first) & (readings.first >= before - self.back)]
        return float(taken.max(initial=-np.inf)) if len(taken) else first

    def _released_ns(self, row: float, assembled: Assembled) -> int:
        """When the frame came by which a row at this time, s, is certain."""
        for readings in assembled.averages.values():
            within = (readings.first <= row) & (row <= readings.last)
            row = max(row, *readings.last[within], row)
        until, moments = row + self.thresholds.ahead, [row]
        for name, time in self.times.items():
            place = int(np.searchsorted(time, until + self.setting.late(name))) + self.lags[name]
            if place < len(time):
                moments.append(float(time[place]))
        return (self.start_ns or 0) + round(max(moments) * 1e9)

    def filtered(self, stretch: Stretch) -> Piece:
        """The estimates over a stretch; those before it have been filtered."""
        line, begins = stretch.line, self.belief is None
        warnings: list[str] = []
        if self.belief is None:
            self.belief, warnings = begun(
                self.vehicle, self.compiled, stretch.assembled.line, self.state, self.start_ns
            )
            self.start = copied(self.belief)
            self.first_s = float(line.t[0])
        filtered = self.filter(self.compiled, line, self.belief, gained=self.gained)
        self.belief, self.last = filtered.final, line
        rows = Rows.of(self.compiled, line, filtered)
        events = self._slips(rows, stretch.last)
        track = track_of(
            self.vehicle, self.compiled, line, filtered, rows, events, self.gained_before
        )
        track = self.consistency.take(track, stretch.last)
        if len(rows.time):
            self.gained_before, self.own = filtered.gained[-1], filtered.P[-1].diagonal()
        new, released_ns = stretch.signals, stretch.released_ns
        return Piece(track, line, filtered, new, begins, released_ns, tuple(warnings))

    def _slips(self, rows: Rows, last: bool) -> Slips:
        """The slip events that are over."""
        recent = rows if self.recent is None else self.recent.then(rows)
        away = np.flatnonzero(recent.mode != self._event)
        if last:
            over, keep = recent, len(recent.time)
        elif len(away):
            over, keep = recent.until(int(away[-1]) + 1), int(away[-1])
        else:
            self.recent = recent
            return NO_SLIPS
        self.recent = recent.since(keep)
        events = engagements(self.compiled, over)
        count = self.history.engagements + len(events.certain)
        self.history = replace(self.history, engagements=count)
        return events

    def _forget(self) -> None:
        since = self.done - self.back
        longest = max(
            (slope_count(self.timings[of].period) for of in self.setting.model.slopes.values()),
            default=1,
        )
        for name, signal in self.samples.items():
            late = self.setting.late(name)
            first = int(np.searchsorted(signal.time, since + late)) - longest - 2
            if first > 0:
                self.samples[name] = signal.take(slice(first, None))

    @property
    def span_s(self) -> float:
        """From the first event to the last."""
        return 0.0 if self.last is None else float(self.last.t[-1]) - self.first_s

    @property
    def past(self) -> History:
        """All drives so far, with this one."""
        if self.belief is None:
            return self.history
        energy = max(float(self.belief.E[0] - self.start.E[0]), 0.0)
        before = History.of(self.state)
        return before.after(self.span_s, self.history.engagements - before.engagements, energy)

    def final(self) -> dict[str, Any] | None:
        """As :func:`clutchest.estimate.initial_state.leave` has it."""
        if self.belief is None or self.last is None:
            return None
        left = leave(self.vehicle, self.compiled, self.last, self.belief, self.start_ns, self.past)
        return contradicted(left, self.consistency.found)


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
        line,
        t=line.t[events],
        sensor=sensor,
        z=line.z[events],
        R=line.R[events],
        u=line.u[events],
        row=line.row[events],
        mode=line.mode[events],
        emit=emit,
        grid=grid,
    )


def begun(
    vehicle: Vehicle,
    compiled: Compiled,
    line: Timeline,
    state: Mapping[str, Any] | None,
    start_ns: int | None,
) -> tuple[Belief, list[str]]:
    """The belief at the first event of a drive, carried on from ``state`` if there is one, and
    warnings."""
    warnings = left_out(vehicle, compiled)
    if state is None:
        return fresh(vehicle, compiled, line), warnings
    belief, warning = carried_on(vehicle, compiled, line, state, start_ns)
    return belief, [*warnings, warning] if warning else warnings


def left_out(vehicle: Vehicle, compiled: Compiled) -> list[str]:
    """A warning where effects of the vehicle file are not in the model."""
    present = {effect.name for effect in compiled.model.effects}
    names = [name for name in vehicle.effect_numbers if name not in present]
    return [f"without {', '.join(names)}: the signals at hand do not show it"] if names else []
