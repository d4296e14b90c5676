"""From a run to an answer: every monitor's verdict, the faults behind them, and their codes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import norm

from clutchest.diagnosis import structure
from clutchest.diagnosis.blocks import blocks_of
from clutchest.diagnosis.codes import number_of_set, status_byte
from clutchest.diagnosis.equations import SHORTEST, Judged, Watched, watch
from clutchest.diagnosis.faults import Alarm, ModelFault, StreamTest, model_faults
from clutchest.diagnosis.isolation import (
    Explanation,
    distances,
    explanations,
    hypotheses,
    told_apart,
)
from clutchest.diagnosis.result import Diagnosis, Fault, Isolability, Monitor
from clutchest.diagnosis.streams import MESSAGE_KINDS, RATE, Streams, part
from clutchest.errors import ClutchestError
from clutchest.estimate.run import Run, Track
from clutchest.estimate.whole_log import Progress
from clutchest.models import model_for
from clutchest.models.effects import Effect, library
from clutchest.signals import Signals

NEEDED = ("slave_position", "input_shaft_speed", "engine_torque", "engine_speed")
UNHARMED = ("late", "counter", "sticking")  # faults that leave the signals' values true
MISFIT = "misfit"  # what no known fault explains
WORN = ("wear", "position_offset")  # the same to every signal
AGAIN = 1.0  # s after a signal is back, until it is believed
BRIDGED = 2.0  # s without a true signal that the equations can do without


@dataclass(frozen=True, slots=True)
class Drive:
    """What was found in one drive."""

    length: float
    streams: Streams
    watched: Watched | None
    why_not: str
    wear: tuple[Alarm | None, str, str]  # alarm, status, why


def diagnose(run: Run, *, progress: Progress | None = None) -> Diagnosis:
    """Fault tests over every drive of ``run``.

    Each monitor fails in a healthy vehicle as seldom as the vehicle file asks for.  What is at
    hand decides which monitors can run; the others say why not.
    """
    vehicle = run.vehicle
    per_1000h = vehicle.monitors.get("false_alarms_per_1000h", RATE)
    drives = []
    for signals, track in zip(run.signals.drives, run.tracks, strict=True):
        length = max(signals.end, float(track.time[-1]) if len(track.time) else 0.0)
        streams = Streams(vehicle)
        streams.take(signals, length)
        watched, why_not = _watched(run, _unharmed(signals, streams, run), per_1000h, progress)
        drives.append(
            Drive(length, streams, watched, why_not, _wear(run, track, per_1000h, length))
        )
    faults = [*_stream_faults(run, drives), *_model_faults(run, drives)]
    faults.sort(key=lambda f: (f.drive, f.first_detected_s))
    return Diagnosis(
        run=run,
        monitors=_monitors(run, drives, per_1000h),
        faults=tuple(faults),
        isolability=_isolability(run, drives),
        provenance=run.provenance,
        lanes=_lanes(drives),
    )


# --- what the tests work on ---------------------------------------------------------------------


def _unharmed(signals: Signals, streams: Streams, run: Run) -> Signals:
    """The signals without what a failed test has shown to be false, and without all that follows a
    longer such stretch: what the clutch did meanwhile, nobody knows."""
    kept, end = dict(signals.signals), np.inf
    for test in streams.tests:
        if test.kind in UNHARMED:
            continue
        names = [test.subject] if test.kind not in MESSAGE_KINDS else [
            n for n, s in run.vehicle.signals.items() if s.bus.message == test.subject
        ]  # fmt: skip
        for name in (n for n in names if n in kept):
            for alarm in test.alarms:
                over = np.inf if alarm.ended is None else alarm.ended + AGAIN
                if name in NEEDED and over - alarm.begun > BRIDGED:
                    end = min(end, alarm.begun)
                s = kept[name]
                keep = (s.time < alarm.begun) | (s.time > over)
                kept[name] = replace(s, time=s.time[keep], value=s.value[keep], why=s.why[keep])
    whole = replace(signals, signals={n: s for n, s in kept.items() if s.valid.any()})
    if end == np.inf:
        return whole
    before = part(whole, 0.0, end)
    usable = {n: s for n, s in before.signals.items() if s.valid.any()}
    return replace(before, signals=usable, end=end)


def effects_for(model: str) -> tuple[Effect, ...]:
    """What is put into the equations: every fault, and wear, which a healthy clutch has too."""
    made = {fault.effect: fault.make() for fault in model_faults(model)}
    return (*made.values(), *(e for name, e in library(model).items() if name == "wear"))


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


# --- faults ---------------------------------------------------------------------------------------


def _stream_faults(run: Run, drives: Sequence[Drive]) -> list[Fault]:
    found: list[Fault] = []
    for number, drive in enumerate(drives):
        for test in drive.streams.tests:
            alarms = [a for a in test.alarms if not _explained(test, a, drive, run)]
            if not alarms:
                continue
            first = alarms[0]
            spn, fmi = number_of_set([test.name], run.vehicle)
            all_of = [
                (d.length, next(t.alarms for t in d.streams.tests if t.name == test.name))
                for d in drives
            ]
            if any(f.fault == test.name for f in found):
                continue  # the code of an earlier drive covers it
            found.append(Fault(
                test.name, (test.name,), number, first.begun, first.detected, first.ended,
                _confidence(test.per_1000h, drive.length), first.what, (),
                _freeze(run, number, first.detected), status_byte(all_of), spn, fmi,
            ))  # fmt: skip
    return found


def _explained(test: StreamTest, alarm: Alarm, drive: Drive, run: Run) -> bool:
    """Whether a fault of the whole message is behind this alarm of a test."""
    message = test.subject
    if test.kind not in MESSAGE_KINDS:
        mapped = run.vehicle.signals.get(test.subject)
        message = mapped.bus.message if mapped else ""
        if test.kind == "sticking":
            message = run.vehicle.signals["slave_position"].bus.message
    stronger = {"missing": (), "frozen": ("missing",), "late": ("missing",),
                "counter": ("missing", "frozen"), "checksum": ("missing",)}  # fmt: skip
    of_message = stronger.get(test.kind, ("missing", "frozen"))
    of_signal = ("stuck", "noise") if test.kind == "sticking" else ()
    for other in drive.streams.tests:
        behind = other.subject == message and other.kind in of_message
        behind |= other.subject in ("slave_position", "motor_position") and other.kind in of_signal
        for a in other.alarms if behind else ():
            over = a.ended is not None and alarm.begun > a.ended + AGAIN
            if alarm.detected >= a.begun - AGAIN and not over:
                return True
    return False


def _model_faults(run: Run, drives: Sequence[Drive]) -> list[Fault]:
    found: list[Fault] = []
    for number, drive in enumerate(drives):
        wear, _, _ = drive.wear
        alarm, causes = _model_alarm(drive)
        about_position = bool(causes) and {"wear", "position_offset"} & set(told_apart(causes))
        if wear is not None:  # a sensor that reads too low shows the same
            found.append(_fault(run, drives, number, WORN, wear, causes, 1.0))
            if about_position:
                continue
        if alarm is not None:
            names = told_apart(causes) or (MISFIT,)
            if "wear" in names:  # within its limit wear is no fault, but a reason to ask
                names = ("position_offset", "wear", *(n for n in names if n not in WORN))
            size = causes[0].size if causes else 0.0
            found.append(_fault(run, drives, number, names, alarm, causes, size))
    first: dict[str, Fault] = {}
    for fault in found:  # one code for the same fault in several drives
        first.setdefault(fault.fault, fault)
    return list(first.values())


def _model_alarm(drive: Drive) -> tuple[Alarm | None, tuple[Explanation, ...]]:
    """What the equations' tests found in a drive: one fault behind all of them."""
    watched = drive.watched
    failed = [j for j in watched.faults if j.detected is not None] if watched else []
    if watched is not None and not failed and watched.misfit_detected is not None:
        end = float(watched.blocks.end[watched.misfit_detected])
        begin = float(watched.blocks.begin[watched.misfit_detected])
        return Alarm(begin, end, what="the clutch does what no known fault explains"), ()
    if watched is None or not failed:
        return None, ()
    onsets = {int(j.onset[k]) if j.begins[k] > 1.0 else 0 for j in failed for k in [j.detected]}
    causes = explanations(watched, sorted(onsets), len(watched.blocks))
    first = min(failed, key=lambda j: j.detected or 0)
    k = first.detected or 0
    blocks = watched.blocks
    began = float(blocks.begin[causes[0].onset]) if causes[0].onset else 0.0
    strength = max(_excess(j) for j in failed)
    what = ", ".join(
        f"{c.fault} {c.size:+.3g} ± {c.std:.2g} {c.unit}".rstrip(" 1")
        for c in causes[: len(told_apart(causes))]
    )
    alarm = Alarm(began, float(blocks.end[k]), chance=float(np.exp(-strength)), what=what)
    return alarm, tuple(causes)


def _excess(judged: Judged) -> float:
    """By how much a log-likelihood ratio leaves its threshold at most."""
    return float(max((judged.begins.max() - 1.0) * judged.begins_at,
                     (judged.was.max() - 1.0) * judged.was_at))  # fmt: skip


def _fault(
    run: Run, drives: Sequence[Drive], number: int, names: Sequence[str], alarm: Alarm,
    causes: Sequence[Explanation], size: float,
) -> Fault:  # fmt: skip
    per_1000h = run.vehicle.monitors.get("false_alarms_per_1000h", RATE)
    spn, fmi = number_of_set(names, run.vehicle, size)
    lengths = [(d.length, [alarm] if i == number else []) for i, d in enumerate(drives)]
    chance = 1.0 - _confidence(per_1000h, drives[number].length)
    return Fault(
        names[0], tuple(names), number, alarm.begun, alarm.detected, None,
        1.0 - chance * alarm.chance, alarm.what, tuple(causes),
        _freeze(run, number, alarm.detected, causes), status_byte(lengths), spn, fmi,
    )  # fmt: skip


def _confidence(per_1000h: float, length: float) -> float:
    """One less the chance of a false alarm within so many s."""
    return float(np.exp(-per_1000h * max(length, 1.0) / 3.6e6))


def _freeze(run: Run, drive: int, time: float, causes: Sequence[Explanation] = ()) -> dict:
    """Mode, states, inputs and ranked causes at ``time`` s of a drive."""
    track, signals = run.tracks[drive], run.signals.drives[drive]
    row = int(np.clip(np.searchsorted(track.time, time, "right") - 1, 0, len(track.time) - 1))
    inputs = {}
    for name, signal in signals.items():
        valid = signal.only_valid()
        at = int(np.searchsorted(valid.time, time, "right")) - 1
        inputs[name] = float(valid.value[at]) if at >= 0 else None
    return {
        "time": float(track.time[row]),
        "mode": track.mode_names[track.mode[row]],
        "states": {
            name: {"value": float(e.value[row]), "std": float(e.std[row]),
                   "valid": bool(e.valid[row])}
            for name, e in track.states.items()
        },
        "clutch_torque": float(track.clutch_torque.value[row]),
        "inputs": inputs,
        "causes": [c.fault for c in causes],
    }  # fmt: skip


# --- monitors ------------------------------------------------------------------------------------


def _monitors(run: Run, drives: Sequence[Drive], per_1000h: float) -> tuple[Monitor, ...]:
    found = []
    for i, test in enumerate(drives[0].streams.tests):
        each = [d.streams.tests[i] for d in drives]
        words = [_stream_status(t, d) for t, d in zip(each, drives, strict=True)]
        chosen = _telling([w for w, _ in words])
        statuses = tuple(status for status, _ in words)
        at = each[chosen].threshold
        found.append(Monitor(test.name, *words[chosen], at, per_1000h, statuses))
    for k, fault in enumerate(model_faults(run.vehicle.model)):
        words = [_model_status(fault, k, d) for d in drives]
        chosen = _telling([w for w, _ in words])
        watched = drives[chosen].watched
        at = watched.faults[k].begins_at if watched else None
        found.append(Monitor(fault.name, words[chosen][0], words[chosen][1], at, per_1000h,
                             tuple(w for w, _ in words)))  # fmt: skip
    words = [_misfit_status(d) for d in drives]
    chosen = _telling([w for w, _ in words])
    watched = drives[chosen].watched
    at = watched.misfit_at if watched else None
    statuses = tuple(w for w, _ in words)
    found.append(Monitor(MISFIT, *words[chosen], at, per_1000h, statuses))
    if "zero_position" in {state.name for state in model_for(run.vehicle.model, NEEDED).states}:
        words = [(d.wear[1], d.wear[2]) for d in drives]
        chosen = _telling([w for w, _ in words])
        limit = run.vehicle.limits.get("wear")
        found.append(Monitor("wear", words[chosen][0], words[chosen][1],
                             limit.value if limit else None, per_1000h,
                             tuple(w for w, _ in words)))  # fmt: skip
    return tuple(found)


def _telling(words: Sequence[str]) -> int:
    """Which drive speaks for all: one that failed, else one that passed."""
    return min(range(len(words)), key=lambda i: ("failed", "passed", "not run").index(words[i]))


def _stream_status(test: StreamTest, drive: Drive) -> tuple[str, str]:
    if test.kind in MESSAGE_KINDS and not drive.streams.frames:
        return "not run", "no frames: these are decoded signals"
    if test.alarms:
        return "failed", "; ".join(a.what for a in test.alarms[:3])
    return ("passed" if test.threshold is not None else "not run"), test.why


def _model_status(fault: ModelFault, k: int, drive: Drive) -> tuple[str, str]:
    if drive.watched is None:
        return "not run", drive.why_not
    judged, unit = drive.watched.faults[k], fault.number.unit
    shown = "" if unit == "1" else f" {unit}"
    if judged.status == "not run":
        return "not run", (f"even the largest plausible size, {judged.unit:g}{shown}, would leave "
                           f"d′ = {judged.d_prime:.2g}; {judged.needed:.2g} is needed")  # fmt: skip
    if judged.status == "failed":
        at = float(drive.watched.blocks.end[judged.detected or 0])
        return "failed", f"log-likelihood ratio beyond {judged.begins_at:.1f} at {at:.1f} s"
    return "passed", f"{judged.detectable:.2g}{shown} and more would show"


def _misfit_status(drive: Drive) -> tuple[str, str]:
    if drive.watched is None:
        return "not run", drive.why_not
    k = drive.watched.misfit_detected
    if k is None:
        return "passed", f"chi-square of each of {len(drive.watched.blocks)} slips and rests"
    return "failed", f"further off at {drive.watched.blocks.end[k]:.1f} s than noise carries it"


def _lanes(drives: Sequence[Drive]) -> dict[str, tuple[tuple[tuple[float, str], ...], ...]]:
    """The status of every monitor over time; those that never ran have none."""
    lanes: dict[str, list[tuple[tuple[float, str], ...]]] = {}
    for i, test in enumerate(drives[0].streams.tests):
        each = [d.streams.tests[i] for d in drives]
        if any(t.threshold is not None for t in each):
            lanes[test.name] = [_changes(t.alarms) for t in each]
    for d in drives:
        for judged in d.watched.faults if d.watched else ():
            if judged.status == "not run":
                continue
            k = judged.detected
            end = d.watched.blocks.end  # type: ignore[union-attr]
            alarms = [] if k is None else [Alarm(0.0, float(end[k]))]
            lanes.setdefault(judged.fault.name, []).append(_changes(alarms))
        if d.watched is not None:
            k = d.watched.misfit_detected
            alarms = [] if k is None else [Alarm(0.0, float(d.watched.blocks.end[k]))]
            lanes.setdefault(MISFIT, []).append(_changes(alarms))
        if d.wear[1] != "not run":
            lanes.setdefault("wear", []).append(_changes([d.wear[0]] if d.wear[0] else []))
    return {name: tuple(of) for name, of in lanes.items() if len(of) == len(drives)}


def _changes(alarms: Sequence[Alarm]) -> tuple[tuple[float, str], ...]:
    found = [(0.0, "passed")]
    for alarm in alarms:
        found.append((alarm.detected, "failed"))
        if alarm.ended is not None:
            found.append((alarm.ended, "passed"))
    return tuple(found)


# --- what could be told -------------------------------------------------------------------------


def _isolability(run: Run, drives: Sequence[Drive]) -> Isolability | None:
    """Of the drive that tells most."""
    able = [d.watched for d in drives if d.watched is not None]
    if not able:
        return None
    watched = max(able, key=lambda w: float(w.residuals.information.sum()))
    known = hypotheses(watched)
    detectable = {j.fault.name: j.detectable for j in watched.faults}
    needed = {j.fault.name: j.fault.size for j in watched.faults}
    sizes = np.array([
        detectable.get(h.name) or needed.get(h.name) or h.scale / 3.0 for h in known
    ])  # fmt: skip
    names, d_prime = distances(watched, sizes)
    usable = {name for drive in run.signals.drives for name in drive}
    model = model_for(run.vehicle.model, usable)
    gains = [(f.name, f.make(), f.key) for f in model_faults(run.vehicle.model)]
    gains += [("wear", e, "amount") for e in effects_for(run.vehicle.model) if e.name == "wear"]
    shown = structure.shown_in(model, gains)
    return Isolability(
        names, tuple(h.unit for h in known), sizes, d_prime,
        tuple(detectable.get(name) for name in names), shown,
    )  # fmt: skip
