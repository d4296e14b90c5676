"""From a run to an answer: every monitor's verdict, the faults behind them, and their codes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from clutchest.diagnosis import structure
from clutchest.diagnosis.codes import MISFIT, number_of_set, status_byte
from clutchest.diagnosis.drive import AGAIN, Drive, effects_for
from clutchest.diagnosis.equations import Judged
from clutchest.diagnosis.faults import Alarm, StreamTest, model_faults
from clutchest.diagnosis.isolation import (
    Explanation,
    distances,
    explanations,
    hypotheses,
    told_apart,
)
from clutchest.diagnosis.monitors import lanes, monitors
from clutchest.diagnosis.refined import refined
from clutchest.diagnosis.result import Diagnosis, Fault, Isolability
from clutchest.diagnosis.streams import false_alarms
from clutchest.estimate.run import Run
from clutchest.progress import Progress

WORN = ("wear", "position_offset")  # the same to every signal


def diagnose(run: Run, *, progress: Progress | None = None) -> Diagnosis:
    """Fault tests over every drive of ``run``.

    Each monitor fails in a healthy vehicle as seldom as the vehicle file asks for.  What is at
    hand decides which monitors can run; the others say why not.
    """
    drives = [
        Drive.of(run, signals, track, progress)
        for signals, track in zip(run.signals.drives, run.tracks, strict=True)
    ]
    faults = [*_stream_faults(run, drives), *_model_faults(run, drives, progress)]
    faults.sort(key=lambda f: (f.drive, f.first_detected_s))
    return Diagnosis(
        run=run,
        monitors=monitors(run, drives),
        faults=tuple(faults),
        isolability=_isolability(run, drives),
        provenance=run.provenance,
        lanes=lanes(drives),
    )


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
            found.append(
                Fault(
                    test.name,
                    (test.name,),
                    number,
                    first.begun,
                    first.detected,
                    first.ended,
                    _confidence(test.per_1000h, drive.length),
                    first.what,
                    (),
                    _freeze(run, number, first.detected),
                    status_byte(all_of),
                    spn,
                    fmi,
                )
            )
    return found


def _explained(test: StreamTest, alarm: Alarm, drive: Drive, run: Run) -> bool:
    """Whether a fault of the whole message is behind this alarm of a test."""
    message = test.subject
    if not test.of_message:
        mapped = run.vehicle.signals.get(test.subject)
        message = mapped.bus.message if mapped else ""
        if test.kind == "sticking":
            message = run.vehicle.signals["slave_position"].bus.message
    of_signal = ("stuck", "noise") if test.kind == "sticking" else ()
    for other in drive.streams.tests:
        behind = other.subject == message and other.kind in test.behind
        behind |= other.subject in ("slave_position", "motor_position") and other.kind in of_signal
        for a in other.alarms if behind else ():
            over = a.ended is not None and alarm.begun > a.ended + AGAIN
            if alarm.detected >= a.begun - AGAIN and not over:
                return True
    return False


def _model_faults(
    run: Run, drives: Sequence[Drive], progress: Progress | None = None
) -> list[Fault]:
    found: list[Fault] = []
    for number, drive in enumerate(drives):
        wear, _, _ = drive.wear
        alarm, causes = _model_alarm(run, drive, progress)
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


def _model_alarm(
    run: Run, drive: Drive, progress: Progress | None = None
) -> tuple[Alarm | None, tuple[Explanation, ...]]:
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
    causes = refined(
        drive.unharmed,
        run.vehicle,
        effects_for(run.vehicle.model),
        watched,
        explanations(watched, sorted(onsets), len(watched.blocks)),
        progress,
    )
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
    return alarm, causes


def _excess(judged: Judged) -> float:
    """By how much a log-likelihood ratio leaves its threshold at most."""
    return float(
        max(
            (judged.begins.max() - 1.0) * judged.begins_at, (judged.was.max() - 1.0) * judged.was_at
        )
    )


def _fault(
    run: Run,
    drives: Sequence[Drive],
    number: int,
    names: Sequence[str],
    alarm: Alarm,
    causes: Sequence[Explanation],
    size: float,
) -> Fault:
    per_1000h = false_alarms(run.vehicle)
    spn, fmi = number_of_set(names, run.vehicle, size)
    lengths = [(d.length, [alarm] if i == number else []) for i, d in enumerate(drives)]
    chance = 1.0 - _confidence(per_1000h, drives[number].length)
    return Fault(
        names[0],
        tuple(names),
        number,
        alarm.begun,
        alarm.detected,
        None,
        1.0 - chance * alarm.chance,
        alarm.what,
        tuple(causes),
        _freeze(run, number, alarm.detected, causes),
        status_byte(lengths),
        spn,
        fmi,
    )


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
            name: {
                "value": float(e.value[row]),
                "std": float(e.std[row]),
                "valid": bool(e.valid[row]),
            }
            for name, e in track.states.items()
        },
        "clutch_torque": float(track.clutch_torque.value[row]),
        "inputs": inputs,
        "causes": [c.fault for c in causes],
    }


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
    sizes = np.array([detectable.get(h.name) or needed.get(h.name) or h.scale / 3.0 for h in known])
    names, d_prime = distances(watched, sizes)
    usable = {name for drive in run.signals.drives for name in drive}
    model = run.vehicle.machine.equations(usable)
    gains = [(f.name, f.make(), f.key) for f in model_faults(run.vehicle.model)]
    gains += [("wear", e, "amount") for e in effects_for(run.vehicle.model) if e.name == "wear"]
    shown = structure.shown_in(model, gains)
    return Isolability(
        names,
        tuple(h.unit for h in known),
        sizes,
        d_prime,
        tuple(detectable.get(name) for name in names),
        shown,
    )
