"""From a run to its diagnosis: the status of every monitor, the faults, and their codes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from clutchest.checked import checked
from clutchest.diagnosis import structure
from clutchest.diagnosis.codes import CONTRADICTION, MISFIT, WEAR, number_of_set, status_byte
from clutchest.diagnosis.contradiction import contradictions
from clutchest.diagnosis.drive_diagnosis import DriveDiagnosis, effects_for
from clutchest.diagnosis.faults import Alarm, StreamTest
from clutchest.diagnosis.freeze_frame import freeze_frame
from clutchest.diagnosis.isolation import (
    Explanation,
    hypotheses,
    not_excluded,
    separability,
)
from clutchest.diagnosis.monitor_status import lanes, monitor_statuses
from clutchest.diagnosis.result import Diagnosis, Fault, Isolability
from clutchest.errors import ClutchestError
from clutchest.estimate.contradiction import Contradiction
from clutchest.estimate.replay import replay
from clutchest.estimate.run import Run
from clutchest.progress import Progress
from clutchest.reading import Logs
from clutchest.signals import Signals
from clutchest.vehicle import Vehicle

Drives = Sequence[DriveDiagnosis]


@checked
def diagnose(
    run: Run | Signals | Logs,
    vehicle: Vehicle | str | Path | None = None,
    *,
    progress: Progress | None = None,
) -> Diagnosis:
    """Fault tests over every drive of ``run``, or of what ``replay`` takes, with its ``vehicle``.

    Each monitor raises false alarms at the rate that the vehicle file states.  The signals at hand
    decide which monitors can run; the others say why not.  Raises ClutchestError where a vehicle is
    given beside a run, which has its own, or none beside logs.
    """
    if not isinstance(run, Run):
        if vehicle is None:
            raise ClutchestError("no vehicle: expected a run, or logs and their vehicle")
        run = replay(run, vehicle, progress=progress)
    elif vehicle is not None:
        raise ClutchestError("a run has its vehicle already; expected a run alone")
    drives = [
        DriveDiagnosis.of(run, signals, track, progress)
        for signals, track in zip(run.signals.drives, run.tracks, strict=True)
    ]
    faults = [*_stream_faults(run, drives), *_model_faults(run, drives)]
    faults.sort(key=lambda f: (f.drive, f.first_detected_s))
    faults = [*contradictions(run, drives), *faults]
    return Diagnosis(
        run=run,
        monitors=monitor_statuses(run, drives),
        faults=tuple(faults),
        isolability=_isolability(run, drives),
        provenance=run.provenance,
        lanes=lanes(drives),
    )


# --- faults of frames and signals -----------------------------------------------------------------


def _stream_faults(run: Run, drives: Drives) -> list[Fault]:
    faults: dict[str, Fault] = {}  # one code for the same fault in several drives
    for number, drive in enumerate(drives):
        for test in drive.streams.tests:
            alarms = [a for a in test.alarms if not drive.streams.masked(test, a)]
            if alarms and test.name not in faults:
                faults[test.name] = _stream_fault(run, drives, number, test, alarms[0])
    return list(faults.values())


def _stream_fault(run: Run, drives: Drives, number: int, test: StreamTest, first: Alarm) -> Fault:
    spn, fmi = number_of_set([test.name], run.vehicle)
    every_drive = [
        (d.length, [a for t in d.streams.tests if t.name == test.name for a in t.alarms])
        for d in drives
    ]
    other = _as_probable(run.tracks[number].contradiction, test, first)
    return Fault(
        fault=test.name,
        set=(
            test.name,
            *_explained(test, drives[number]),
            *(f"{CONTRADICTION}:{o.signal}" for o in other),
        ),
        drive=number,
        began_s=first.begun,
        first_detected_s=first.detected,
        ended_s=first.ended,
        confidence=_confidence(test.per_1000h, drives[number].length),
        what="; or ".join([first.what, *(each.explanation for each in other)]),
        causes=(),
        freeze_frame=freeze_frame(run, number, first.detected),
        status_byte=status_byte(every_drive),
        spn=spn,
        fmi=fmi,
    )


def _explained(test: StreamTest, drive: DriveDiagnosis) -> list[str]:
    """The messages that are missing because nothing is sent at all, as faults."""
    return [
        other.name
        for other in drive.streams.tests
        if other.kind == "missing"
        and any(test in drive.streams.masked(other, alarm) for alarm in other.alarms)
    ]


def _as_probable(
    found: Contradiction | None, test: StreamTest, first: Alarm
) -> list[Contradiction]:
    """The contradiction that says as much of a part which has not worked since the log began."""
    if found is None or not found.is_explained or first.begun or not test.of_part:
        return []
    return [found] if found.signal in test.signals else []


# --- faults of the equations ----------------------------------------------------------------------


def _model_faults(run: Run, drives: Drives) -> list[Fault]:
    faults: list[Fault] = []
    wear = run.vehicle.machine.wear
    same = () if wear is None else wear.same_as  # faults that no signal distinguishes from wear
    for number, drive in enumerate(drives):
        alarm, causes = drive.alarm, drive.causes
        if drive.wear.alarm is not None:
            worn = (WEAR, *same)
            faults.append(_model_fault(run, drives, number, worn, drive.wear.alarm, causes))
            if set(worn) & set(not_excluded(causes)):
                continue
        if alarm is not None:
            names = not_excluded(causes) or (MISFIT,)
            if WEAR in names:  # within its limit wear is no fault, but explains as much
                names = (*same, WEAR, *(n for n in names if n not in (WEAR, *same)))
            faults.append(_model_fault(run, drives, number, names, alarm, causes))
    first: dict[str, Fault] = {}
    for fault in faults:  # one code for the same fault in several drives
        first.setdefault(fault.fault, fault)
    return list(first.values())


def _model_fault(
    run: Run,
    drives: Drives,
    number: int,
    names: Sequence[str],
    alarm: Alarm,
    causes: Sequence[Explanation],
) -> Fault:
    size = causes[0].size if causes else 0.0
    spn, fmi = number_of_set(names, run.vehicle, size)
    every_drive = [(d.length, [alarm] if i == number else []) for i, d in enumerate(drives)]
    chance = 1.0 - _confidence(run.vehicle.false_alarms_per_1000h, drives[number].length)
    return Fault(
        fault=names[0],
        set=tuple(names),
        drive=number,
        began_s=alarm.begun,
        first_detected_s=alarm.detected,
        ended_s=None,
        confidence=1.0 - chance * alarm.chance,
        what=alarm.what,
        causes=tuple(causes),
        freeze_frame=freeze_frame(run, number, alarm.detected, causes),
        status_byte=status_byte(every_drive),
        spn=spn,
        fmi=fmi,
    )


def _confidence(per_1000h: float, length: float) -> float:
    """1 − the probability of a false alarm within so many s."""
    return float(np.exp(-per_1000h * max(length, 1.0) / 3.6e6))


# --- isolability ----------------------------------------------------------------------------------


def _isolability(run: Run, drives: Drives) -> Isolability | None:
    """Of the drive with the most information."""
    tested = [d.equations for d in drives if d.equations is not None]
    if not tested:
        return None
    results = max(tested, key=lambda r: float(r.residuals.information.sum()))
    known = hypotheses(results)
    detectable = {r.fault.name: r.detectable for r in results.faults}
    smallest = {r.fault.name: r.fault.size for r in results.faults}
    sizes = np.array(
        [detectable.get(h.name) or smallest.get(h.name) or h.scale / 3.0 for h in known]
    )
    names, d_prime = separability(results, sizes)
    return Isolability(
        names,
        tuple(h.unit for h in known),
        sizes,
        d_prime,
        tuple(detectable.get(name) for name in names),
        _affected(run),
    )


def _affected(run: Run) -> dict[str, tuple[structure.AffectedSensor, ...]]:
    """Fault → the sensors, of those with readings, that it affects."""
    usable = {name for drive in run.signals.drives for name in drive}
    machine = run.vehicle.machine
    model, wear = machine.to_fit(usable), machine.wear
    effects = {e.name: e for e in effects_for(machine)}
    gains = [(f.name, effects[f.effect.name], f.key) for f in machine.faults]
    if wear is not None and wear.effect in effects:
        gains.append((WEAR, effects[wear.effect], wear.amount))
    read = {name for name, sensor in run.summary["sensors"].items() if sensor["count"]}
    return {
        fault: tuple(each for each in sensors if each.sensor in read)
        for fault, sensors in structure.affected_sensors(model, gains).items()
    }
