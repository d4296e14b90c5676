"""Signals that contradict the model: a fault of a signal, before any of the machine."""

from __future__ import annotations

from collections.abc import Sequence

from clutchest.diagnosis.codes import CONTRADICTION, number_of, status_byte
from clutchest.diagnosis.drive_diagnosis import DriveDiagnosis
from clutchest.diagnosis.faults import Alarm
from clutchest.diagnosis.freeze_frame import freeze_frame
from clutchest.diagnosis.result import Fault
from clutchest.estimate.contradiction import MISFIT, Contradiction
from clutchest.estimate.run import Run
from clutchest.vehicle import Vehicle

SURE = 5.0  # standard deviations


def contradictions(run: Run, drives: Sequence[DriveDiagnosis]) -> list[Fault]:
    """The first drive's fault of every signal in question, with its best explanation.

    It is none where the drive's tests of frames and signals say more, nor a misfit whose cause
    the tests of the equations name.
    """
    faults: dict[str, Fault] = {}
    for number, (track, drive) in enumerate(zip(run.tracks, drives, strict=True)):
        found = track.contradiction
        if found is None or _is_named(found, drive, run.vehicle) or drive.streams.explain(found):
            continue
        name = f"{CONTRADICTION}:{found.signal}"
        spn, fmi = number_of(name, run.vehicle)
        alarm = Alarm(0.0, found.since_s)
        faults.setdefault(
            name,
            Fault(
                fault=name,
                set=(name, *(f"{CONTRADICTION}:{other}" for other in found.others)),
                drive=number,
                began_s=0.0,
                first_detected_s=found.since_s,
                ended_s=None,
                confidence=1.0 - run.vehicle.false_alarms_per_1000h * drive.length / 3.6e6,
                what=f"{found.explanation} ({found.words})",
                causes=(),
                freeze_frame=freeze_frame(run, number, found.since_s),
                status_byte=status_byte(
                    [(d.length, [alarm] if i == number else []) for i, d in enumerate(drives)]
                ),
                spn=spn,
                fmi=fmi,
            ),
        )
    return list(faults.values())


def _is_named(found: Contradiction, drive: DriveDiagnosis, vehicle: Vehicle) -> bool:
    """Whether a fault of the equations may be the reason of a misfit: surely there, as large as
    matters, and no further than is plausible."""
    best = drive.causes[0] if drive.causes else None
    if found.kind != MISFIT or best is None or not best.determined:
        return False
    fault = next((f for f in vehicle.machine.faults if f.name == best.fault), None)
    if fault is None:
        return False
    plausible = fault.gain.lower + best.std < best.size < fault.gain.upper - best.std
    return plausible and abs(best.size) > max(SURE * best.std, fault.size)
