"""The status of every monitor, with its reason and over time."""

from __future__ import annotations

from collections.abc import Sequence
from math import exp

from clutchest.diagnosis.codes import MISFIT, WEAR
from clutchest.diagnosis.drive_diagnosis import DriveDiagnosis
from clutchest.diagnosis.faults import Alarm, StreamTest
from clutchest.diagnosis.result import STATUSES, MonitorStatus
from clutchest.estimate.run import Run
from clutchest.models.fault import ModelFault
from clutchest.shown import with_unit

Lanes = dict[str, tuple[tuple[tuple[float, str], ...], ...]]


def monitor_statuses(run: Run, drives: Sequence[DriveDiagnosis]) -> tuple[MonitorStatus, ...]:
    """Every monitor with its status over all drives, and the reason of the most telling one."""
    machine = run.vehicle.machine
    monitors = []
    for name, each in _stream_tests(drives).items():
        words = [_stream_status(t, d) for t, d in zip(each, drives, strict=True)]
        monitors.append(_monitor(run, name, words, [t.threshold if t else None for t in each]))
    for k, fault in enumerate(machine.faults):
        words = [_fault_status(fault, k, d) for d in drives]
        at = [d.equations.faults[k].begins_at if d.equations else None for d in drives]
        monitors.append(_monitor(run, fault.name, words, at))
    words = [_misfit_status(d) for d in drives]
    at = [d.equations.misfit_at if d.equations else None for d in drives]
    monitors.append(_monitor(run, MISFIT, words, at))
    if machine.wear is not None:
        limit = run.vehicle.limits.get(WEAR)
        words = [(d.wear.status, d.wear.why) for d in drives]
        monitors.append(_monitor(run, WEAR, words, [limit.value if limit else None] * len(drives)))
    return tuple(monitors)


def _monitor(
    run: Run, name: str, words: Sequence[tuple[str, str]], at: Sequence[float | None]
) -> MonitorStatus:
    """From status, reason and threshold of each drive; a failed drive takes precedence over a
    passed one, and that over one that was not run."""
    statuses = tuple(status for status, _ in words)
    chosen = min(range(len(statuses)), key=lambda i: STATUSES.index(statuses[i]))
    return MonitorStatus(
        name, *words[chosen], at[chosen], run.vehicle.false_alarms_per_1000h, statuses
    )


def _stream_tests(drives: Sequence[DriveDiagnosis]) -> dict[str, list[StreamTest | None]]:
    """Name → test of each drive, None in a drive without that channel."""
    tests = [{test.name: test for test in drive.streams.tests} for drive in drives]
    names = dict.fromkeys(name for drive in tests for name in drive)
    return {name: [drive.get(name) for drive in tests] for name in names}


def _stream_status(test: StreamTest | None, drive: DriveDiagnosis) -> tuple[str, str]:
    if test is None:
        return "not run", "no mapped message on this channel, or no other channel"
    if test.of_message and not drive.streams.frames:
        return "not run", "no frames: these are decoded signals"
    if test.alarms:
        return "failed", "; ".join(a.what for a in test.alarms[:3])
    return ("passed" if test.threshold is not None else "not run"), test.why


def _fault_status(fault: ModelFault, k: int, drive: DriveDiagnosis) -> tuple[str, str]:
    if drive.equations is None:
        return "not run", drive.why_not
    result = drive.equations.faults[k]
    unit = fault.gain.unit
    if result.status == "not run":
        return "not run", (
            f"even the largest plausible size, {with_unit(f'{result.unit:g}', unit)}, would "
            f"have a separability of {result.d_prime:.2g} σ; {result.needed:.2g} σ are needed"
        )
    if result.status == "failed":
        at = float(drive.equations.blocks.end[result.detected or 0])
        return "failed", f"log-likelihood ratio above {result.begins_at:.1f} at {at:.1f} s"
    least = with_unit(f"{result.detectable:.2g}", unit)
    return "passed", (
        f"limit: a log-likelihood ratio of {result.begins_at:.1f}; half of all faults of {least} "
        "exceed it"
    )


def _misfit_status(drive: DriveDiagnosis) -> tuple[str, str]:
    if drive.equations is None:
        return "not run", drive.why_not
    blocks, k = drive.equations.blocks, drive.equations.misfit_detected
    if k is None:
        limit = exp(-drive.equations.misfit_at)
        return "passed", f"limit: chi-square with p = {limit:.1g} in each of {len(blocks)} blocks"
    return "failed", f"chi-square above its threshold at {blocks.end[k]:.1f} s"


def lanes(drives: Sequence[DriveDiagnosis]) -> Lanes:
    """Monitor → (time s, status) per drive, of those that ran in every drive."""
    changes: dict[str, list[tuple[tuple[float, str], ...]]] = {}
    for name, each in _stream_tests(drives).items():
        if any(t is not None and t.threshold is not None for t in each):
            changes[name] = [_changes(t.alarms if t else []) for t in each]
    for d in drives:
        if d.equations is not None:
            end = d.equations.blocks.end
            detected = {
                r.fault.name: r.detected for r in d.equations.faults if r.status != "not run"
            }
            for name, k in {**detected, MISFIT: d.equations.misfit_detected}.items():
                alarms = [] if k is None else [Alarm(0.0, float(end[k]))]
                changes.setdefault(name, []).append(_changes(alarms))
        if d.wear.status != "not run":
            alarms = [d.wear.alarm] if d.wear.alarm else []
            changes.setdefault(WEAR, []).append(_changes(alarms))
    return {name: tuple(of) for name, of in changes.items() if len(of) == len(drives)}


def _changes(alarms: Sequence[Alarm]) -> tuple[tuple[float, str], ...]:
    changes = [(0.0, "passed")]
    for alarm in alarms:
        changes.append((alarm.detected, "failed"))
        if alarm.ended is not None:
            changes.append((alarm.ended, "passed"))
    return tuple(changes)
