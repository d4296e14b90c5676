"""One drive under all tests: of its frames and signals, of its equations, and its wear."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtr, ndtri

from clutchest.diagnosis.blocks import blocks_at, problem_of
from clutchest.diagnosis.codes import WEAR
from clutchest.diagnosis.fault_tests import SHORTEST_H, FaultTestResults, run_fault_tests
from clutchest.diagnosis.faults import Alarm, StreamTest
from clutchest.diagnosis.isolation import Explanation, explanations, not_excluded
from clutchest.diagnosis.refit import refitted
from clutchest.diagnosis.streams import RECOVERY_S, SILENT_BUS, StreamTests, between
from clutchest.errors import ClutchestError
from clutchest.estimate.contradiction import MISFIT
from clutchest.estimate.run import Run, Track
from clutchest.estimate.worn import as_found
from clutchest.inference.problem import Problem
from clutchest.models.effects import Effect
from clutchest.models.machine import Machine
from clutchest.progress import Progress
from clutchest.quantity import Quantity
from clutchest.shown import plus_minus, with_unit
from clutchest.signals import Signals
from clutchest.vehicle import Vehicle

BRIDGED_S = 2.0  # s without valid samples that the equations' tests can bridge


@dataclass(frozen=True, slots=True)
class WearTest:
    """Wear against its limit: ``status`` and ``why`` as of a monitor, ``alarm`` if it failed."""

    alarm: Alarm | None
    status: str
    why: str


@dataclass(frozen=True, slots=True)
class DriveDiagnosis:
    """The results of one drive of ``length`` s; ``equations`` were tested on the ``valid`` signals,
    None where they could not be, ``why_not`` says why; the ``alarm`` of these tests and the faults
    that explain it, best first."""

    length: float
    valid: Signals
    streams: StreamTests
    equations: FaultTestResults | None
    why_not: str
    alarm: Alarm | None
    causes: tuple[Explanation, ...]
    wear: WearTest

    @classmethod
    def of(
        cls, run: Run, signals: Signals, track: Track, progress: Progress | None = None
    ) -> DriveDiagnosis:
        """One of the drives of ``run``."""
        per_1000h = run.vehicle.false_alarms_per_1000h
        length = max(signals.end, float(track.time[-1]) if len(track.time) else 0.0)
        streams = StreamTests(run.vehicle)
        streams.take(signals, length)
        valid = _valid(signals, streams, run)
        equations: FaultTestResults | None = None
        alarm: Alarm | None = None
        causes: tuple[Explanation, ...] = ()
        why_not = "signals and model contradict each other"
        found = track.contradiction
        if found is None or found.kind == MISFIT or streams.explain(found):
            worn = replace(run, vehicle=as_found(run.vehicle, track) or run.vehicle)
            tested = _equations(worn, signals, valid, per_1000h, progress)
            if isinstance(tested, str):
                why_not = tested
            else:
                (problem, equations), why_not = tested, ""
                alarm, causes = _explained(problem, equations, progress)
        wear = _wear(run, track, per_1000h, length)
        return cls(length, valid, streams, equations, why_not, alarm, causes, wear)


def _valid(signals: Signals, streams: StreamTests, run: Run) -> Signals:
    """The signals without the stretches in which a test failed, and, for a signal that the
    equations need, up to the first stretch too long to bridge."""
    kept, end = dict(signals.signals), np.inf
    for test in streams.tests:
        if test.harmless:
            continue
        for name in _signals_of(test, run.vehicle):
            if name not in kept:
                continue
            for alarm in test.alarms:
                if any(other.name == SILENT_BUS for other in streams.masked(test, alarm)):
                    continue  # a gap of the log as a whole, which estimates bridge
                over = np.inf if alarm.ended is None else alarm.ended + RECOVERY_S
                if name in run.vehicle.machine.fault_signals and over - alarm.begun > BRIDGED_S:
                    end = min(end, alarm.begun)
                time = kept[name].time
                kept[name] = kept[name].take((time < alarm.begun) | (time > over))
    whole = replace(signals, signals={n: s for n, s in kept.items() if s.valid.any()})
    if end == np.inf:
        return whole
    before = between(whole, 0.0, end)
    usable = {n: s for n, s in before.signals.items() if s.valid.any()}
    return replace(before, signals=usable, end=end)


def _signals_of(test: StreamTest, vehicle: Vehicle) -> Sequence[str]:
    """The signals that are of no use to the equations while ``test`` fails."""
    if not test.of_message:
        return test.signals if test.of_part else [test.subject]
    return [name for name, s in vehicle.signals.items() if s.bus.message == test.subject]


def effects_for(machine: Machine) -> tuple[Effect, ...]:
    """The effects in the equations: of every fault, and those in which healthy vehicles differ."""
    faults = [fault.effect for fault in machine.faults]
    effects = {effect.name: machine.effects.get(effect.name, effect) for effect in faults}
    for name, effect in machine.effects.items():
        if any(gain.healthy for gain in effect.gains):
            effects.setdefault(name, effect)
    return tuple(effects.values())


def _equations(
    run: Run, drive: Signals, signals: Signals, per_1000h: float, progress: Progress | None
) -> tuple[Problem, FaultTestResults] | str:
    """The equations of the valid ``signals`` of a ``drive`` and their tests, or why there are
    none."""
    machine = run.vehicle.machine
    if not machine.faults:
        return f"'{machine.name}' declares no faults that its equations show"
    lacking = [name for name in machine.fault_signals if name not in drive.available]
    if not lacking and not set(machine.fault_signals) <= signals.available:
        return "a signal that the fault tests of the equations need has failed from the start"
    if lacking:
        return f"the fault tests of the equations need {', '.join(lacking)}"
    try:
        problem = problem_of(signals, run.vehicle, effects_for(machine), progress)
        blocks = blocks_at(problem, progress=progress)
    except ClutchestError as error:
        return str(error)
    if not len(blocks):
        return "no reading of a sensor that the equations predict"
    if progress:
        progress("testing", None)
    return problem, run_fault_tests(blocks, machine, per_1000h, signals.end / 3600.0)


def _explained(
    problem: Problem, results: FaultTestResults, progress: Progress | None
) -> tuple[Alarm | None, tuple[Explanation, ...]]:
    """The alarm of the equations' tests in a drive, and the faults that explain it, best first."""
    failed = [r for r in results.faults if r.detected is not None]
    blocks = results.blocks
    if not failed:
        if (k := results.misfit_detected) is None:
            return None, ()
        what = "deviations from the model that no known fault explains"
        return Alarm(float(blocks.begin[k]), float(blocks.end[k]), what=what), ()
    onsets = {int(r.onset[k]) if r.begins[k] > 1.0 else 0 for r in failed for k in [r.detected]}
    likely = explanations(results, sorted(onsets), len(blocks))
    causes = refitted(problem, results, likely, progress)
    detected = min(r.detected for r in failed if r.detected is not None)
    began = causes[0].began_s
    if began is None:
        began = float(blocks.begin[causes[0].onset]) if causes[0].onset else 0.0
    chance = float(np.exp(-max(r.excess for r in failed)))
    possible = causes[: len(not_excluded(causes))]
    what = ", ".join(_with_meaning(cause, problem.vehicle.machine) for cause in possible)
    return Alarm(began, float(blocks.end[detected]), chance=chance, what=what), causes


def _with_meaning(cause: Explanation, machine: Machine) -> str:
    """A cause with its size, and what that means where its effect has words for it."""
    words = f"{cause.fault} {cause.magnitude}"
    for fault in machine.faults:
        if fault.name == cause.fault and cause.determined and fault.key in fault.effect.wording:
            return f"{words} ({fault.effect.wording[fault.key].of(cause.size)})"
    return words


def _wear(run: Run, track: Track, per_1000h: float, length: float) -> WearTest:
    """Whether wear is beyond its limit by more than the estimate's uncertainty explains."""
    wear, limit = run.vehicle.machine.wear, run.vehicle.limits.get(WEAR)
    if wear is None:
        return WearTest(None, "not run", f"'{run.vehicle.machine.name}' declares no wear")
    if limit is None:
        return WearTest(None, "not run", "the vehicle file states no limit of wear")
    state = track.states.get(wear.state)
    if state is None or not state.valid.any():
        name = wear.state.replace("_", " ")
        return WearTest(None, "not run", f"the {name} is not identifiable from this log")
    nominal = run.vehicle.parameters[wear.nominal].value
    hours = max(length / 3600.0, SHORTEST_H)
    reach = float(-ndtri(per_1000h * hours / 1000.0))
    worn = wear.sign * (state.value - nominal)
    exceeded = state.valid & (worn - limit.value > reach * state.std)
    last = int(np.flatnonzero(state.valid)[-1])
    shown = Quantity(wear.state, wear.unit)
    value, std, most = shown.read(np.array([worn[last], state.std[last], limit.value]))
    now = with_unit(plus_minus(value, std), shown.shown)
    words = f"{now} of {most:g} {shown.shown}"
    if not exceeded.any():
        reach_words = f"limit: {most:g} {shown.shown} from {wear.nominal}; now {now}"
        return WearTest(None, "passed", reach_words)
    k = int(np.argmax(exceeded))
    chance = float(ndtr((limit.value - worn[k]) / state.std[k]))
    alarm = Alarm(0.0, float(track.time[k]), chance=chance, what=f"worn by {words}")
    return WearTest(alarm, "failed", words)
