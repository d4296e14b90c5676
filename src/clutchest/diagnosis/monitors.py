"""What became of every monitor, in words and over time."""

from __future__ import annotations

from collections.abc import Sequence

from clutchest.diagnosis.codes import MISFIT
from clutchest.diagnosis.drive import NEEDED, Drive
from clutchest.diagnosis.faults import Alarm, ModelFault, StreamTest, model_faults
from clutchest.diagnosis.result import Monitor
from clutchest.diagnosis.streams import false_alarms
from clutchest.estimate.run import Run


def monitors(run: Run, drives: Sequence[Drive]) -> tuple[Monitor, ...]:
    """Every monitor with its status over all drives, and of the one that tells most, why."""
    found = []
    for i, test in enumerate(drives[0].streams.tests):
        each = [d.streams.tests[i] for d in drives]
        words = [_stream_status(t, d) for t, d in zip(each, drives, strict=True)]
        found.append(_monitor(run, test.name, words, [t.threshold for t in each]))
    for k, fault in enumerate(model_faults(run.vehicle.model)):
        words = [_model_status(fault, k, d) for d in drives]
        at = [d.watched.faults[k].begins_at if d.watched else None for d in drives]
        found.append(_monitor(run, fault.name, words, at))
    words = [_misfit_status(d) for d in drives]
    found.append(
        _monitor(run, MISFIT, words, [d.watched.misfit_at if d.watched else None for d in drives])
    )
    if "zero_position" in {state.name for state in run.vehicle.machine.equations(NEEDED).states}:
        limit = run.vehicle.limits.get("wear")
        words = [d.wear[1:] for d in drives]
        found.append(_monitor(run, "wear", words, [limit.value if limit else None] * len(drives)))
    return tuple(found)


def _monitor(
    run: Run, name: str, words: Sequence[tuple[str, str]], at: Sequence[float | None]
) -> Monitor:
    """From status and why, and the threshold, of each drive: the drive that tells most speaks."""
    statuses = tuple(status for status, _ in words)
    chosen = _telling(statuses)
    return Monitor(name, *words[chosen], at[chosen], false_alarms(run.vehicle), statuses)


def _telling(words: Sequence[str]) -> int:
    """Which drive speaks for all: one that failed, else one that passed."""
    return min(range(len(words)), key=lambda i: ("failed", "passed", "not run").index(words[i]))


def _stream_status(test: StreamTest, drive: Drive) -> tuple[str, str]:
    if test.of_message and not drive.streams.frames:
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
        return "not run", (
            f"even the largest plausible size, {judged.unit:g}{shown}, would leave "
            f"d′ = {judged.d_prime:.2g}; {judged.needed:.2g} is needed"
        )
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


def lanes(drives: Sequence[Drive]) -> dict[str, tuple[tuple[tuple[float, str], ...], ...]]:
    """The status of every monitor over time; those that never ran have none."""
    found: dict[str, list[tuple[tuple[float, str], ...]]] = {}
    for i, test in enumerate(drives[0].streams.tests):
        each = [d.streams.tests[i] for d in drives]
        if any(t.threshold is not None for t in each):
            found[test.name] = [_changes(t.alarms) for t in each]
    for d in drives:
        for judged in d.watched.faults if d.watched else ():
            if judged.status == "not run":
                continue
            k = judged.detected
            end = d.watched.blocks.end  # type: ignore[union-attr]
            alarms = [] if k is None else [Alarm(0.0, float(end[k]))]
            found.setdefault(judged.fault.name, []).append(_changes(alarms))
        if d.watched is not None:
            k = d.watched.misfit_detected
            alarms = [] if k is None else [Alarm(0.0, float(d.watched.blocks.end[k]))]
            found.setdefault(MISFIT, []).append(_changes(alarms))
        if d.wear[1] != "not run":
            found.setdefault("wear", []).append(_changes([d.wear[0]] if d.wear[0] else []))
    return {name: tuple(of) for name, of in found.items() if len(of) == len(drives)}


def _changes(alarms: Sequence[Alarm]) -> tuple[tuple[float, str], ...]:
    found = [(0.0, "passed")]
    for alarm in alarms:
        found.append((alarm.detected, "failed"))
        if alarm.ended is not None:
            found.append((alarm.ended, "passed"))
    return tuple(found)
