"""One drive under all tests: of its frames and signals, of its equations, and its wear."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import norm

from clutchest.diagnosis.blocks import blocks_of
from clutchest.diagnosis.equations import SHORTEST, Watched, watch
from clutchest.diagnosis.faults import Alarm, model_faults
from clutchest.diagnosis.streams import Streams, false_alarms, part
from clutchest.errors import ClutchestError
from clutchest.estimate.run import Run, Track
from clutchest.models import machine_of
from clutchest.models.effects import Effect
from clutchest.progress import Progress
from clutchest.signals import Signals

NEEDED = ("slave_position", "input_shaft_speed", "engine_torque", "engine_speed")
AGAIN = 1.0  # s after a signal is back, until it is believed
BRIDGED = 2.0  # s without a true signal that the equations can do without


@dataclass(frozen=True, slots=True)
class Drive:
    """What was found in one drive; the equations were asked of the ``unharmed`` signals."""

    length: float
    unharmed: Signals
    streams: Streams
    watched: Watched | None
    why_not: str
    wear: tuple[Alarm | None, str, str]  # alarm, status, why

    @classmethod
    def of(
        cls, run: Run, signals: Signals, track: Track, progress: Progress | None = None
    ) -> Drive:
        """One of the drives of ``run``."""
        per_1000h = false_alarms(run.vehicle)
        length = max(signals.end, float(track.time[-1]) if len(track.time) else 0.0)
        streams = Streams(run.vehicle)
        streams.take(signals, length)
        unharmed = _unharmed(signals, streams, run)
        watched, why_not = _watched(run, unharmed, per_1000h, progress)
        wear = _wear(run, track, per_1000h, length)
        return cls(length, unharmed, streams, watched, why_not, wear)


def _unharmed(signals: Signals, streams: Streams, run: Run) -> Signals:
    """The signals without what a failed test has shown to be false, and without all that follows a
    longer such stretch: what the clutch did meanwhile, nobody knows."""
    kept, end = dict(signals.signals), np.inf
    for test in streams.tests:
        if test.harmless:
            continue
        names = (
            [test.subject]
            if not test.of_message
            else [n for n, s in run.vehicle.signals.items() if s.bus.message == test.subject]
        )
        for name in (n for n in names if n in kept):
            for alarm in test.alarms:
                over = np.inf if alarm.ended is None else alarm.ended + AGAIN
                if name in NEEDED and over - alarm.begun > BRIDGED:
                    end = min(end, alarm.begun)
                time = kept[name].time
                kept[name] = kept[name].take((time < alarm.begun) | (time > over))
    whole = replace(signals, signals={n: s for n, s in kept.items() if s.valid.any()})
    if end == np.inf:
        return whole
    before = part(whole, 0.0, end)
    usable = {n: s for n, s in before.signals.items() if s.valid.any()}
    return replace(before, signals=usable, end=end)


def effects_for(model: str) -> tuple[Effect, ...]:
    """What is put into the equations: every fault, and what healthy vehicles differ by too."""
    made = {fault.effect: fault.make() for fault in model_faults(model)}
    for name, effect in machine_of(model).effects.items():
        if any(gain.healthy for gain in effect.gains):
            made.setdefault(name, effect)
    return tuple(made.values())


def _watched(
    run: Run, signals: Signals, per_1000h: float, progress: Progress | None
) -> tuple[Watched | None, str]:
    vehicle = run.vehicle
    faults = model_faults(vehicle.model)
    if not faults:
        return None, f"no fault of '{vehicle.model}' is known to the equations' tests"
    lacking = [name for name in NEEDED if name not in signals]
    if lacking:
        return None, f"without {', '.join(lacking)} the equations show no fault"
    try:
        blocks = blocks_of(signals, vehicle, effects_for(vehicle.model), progress)
    except ClutchestError as problem:
        return None, str(problem)
    if not len(blocks):
        return None, "the clutch never slipped, and the actuator was never retracted"
    if progress:
        progress("testing", None)
    return watch(blocks, faults, per_1000h, signals.end / 3600.0), ""


def _wear(run: Run, track: Track, per_1000h: float, length: float) -> tuple[Alarm | None, str, str]:
    """Wear against its limit: the estimate's own uncertainty says when it is surely beyond."""
    limit = run.vehicle.limits.get("wear")
    state = track.states.get("zero_position")
    if limit is None:
        return None, "not run", "the vehicle file states no limit of wear"
    if state is None or not state.valid.any():
        return None, "not run", "nothing in this log tells the zero position"
    nominal = run.vehicle.parameters["zero_position_ref"].value
    hours = max(length / 3600.0, SHORTEST)
    reach = float(norm.isf(per_1000h * hours / 1000.0))
    worn = nominal - state.value
    beyond = state.valid & (worn - limit.value > reach * state.std)
    last = int(np.flatnonzero(state.valid)[-1])
    told = f"{worn[last]:.2f} ± {state.std[last]:.2f} mm of {limit.value:g} mm"
    if not beyond.any():
        return None, "passed", told
    k = int(np.argmax(beyond))
    chance = float(norm.sf((worn[k] - limit.value) / state.std[k]))
    return Alarm(0.0, float(track.time[k]), chance=chance, what=f"worn by {told}"), "failed", told
