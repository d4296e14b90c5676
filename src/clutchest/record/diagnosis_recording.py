"""A diagnosis in a run's recording: a lane per monitor, a log, and a freeze frame per fault."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import rerun as rr

from clutchest.diagnosis.result import Diagnosis
from clutchest.diagnosis.structure import estimates_resting_on
from clutchest.estimate.consistency import valid_where
from clutchest.estimate.run import Run
from clutchest.estimate.whole_log import present_effects
from clutchest.models.model import POWER
from clutchest.record.diagnosis_report import details, freeze_frame, headline
from clutchest.record.series import send_lane

COLOURS = {"passed": 0x2F5D50FF, "failed": 0xE4572EFF}
STUCK = "stuck"  # kind of a fault, before the signal's name
MOST_LANES = 8  # more would be too thin to read
HINT = "Click the time of a fault above: its freeze frame is shown here."


def without_what_rests_on_faults(diagnosis: Diagnosis) -> Run:
    """The run with no estimate valid while a signal that it rests on is stuck."""
    run, tracks = diagnosis.run, list(diagnosis.run.tracks)
    drives, vehicle = run.signals.drives, run.vehicle
    for fault in diagnosis.faults:
        kind, _, signal = fault.fault.partition(":")
        if kind != STUCK:
            continue
        model = vehicle.machine.equations(drives[fault.drive].available)
        effects = model.taking(present_effects(vehicle))
        resting = estimates_resting_on(model.with_effects(effects), signal)
        called = {vehicle.machine.output: "clutch_torque", POWER: "slip_energy"}
        names = {called.get(name, name) for name in resting}
        time = tracks[fault.drive].time
        end = np.inf if fault.ended_s is None else fault.ended_s
        still = (time < fault.began_s) | (time > end)
        tracks[fault.drive] = valid_where(tracks[fault.drive], still, names)
    return replace(run, tracks=tuple(tracks))


def send_faults(
    stream: rr.RecordingStream, diagnosis: Diagnosis, starts: Sequence[float]
) -> list[str]:
    """A lane per monitor, the log of faults, and their freeze frames."""
    shown = []
    for name, drives in lanes_of(diagnosis).items():
        changes = [
            (start + time, word)
            for start, drive in zip(starts, drives, strict=True)
            for time, word in drive
        ]
        send_lane(stream, entity(name), changes, COLOURS)
        shown.append(entity(name))
    send_log(stream, diagnosis, starts)
    return shown


def lanes_of(diagnosis: Diagnosis) -> dict[str, tuple[tuple[tuple[float, str], ...], ...]]:
    """Lanes that are shown: monitors that failed, then those of the clutch itself."""
    failed = {m.name for m in diagnosis.monitors if m.status == "failed"}
    names = sorted(diagnosis.lanes, key=lambda n: (n not in failed, ":" in n))
    return {name: diagnosis.lanes[name] for name in names[:MOST_LANES]}


def entity(name: str) -> str:
    """Where a fault is logged in the recording."""
    return f"fault/{name.replace(':', '/')}"


def send_log(stream: rr.RecordingStream, diagnosis: Diagnosis, starts: Sequence[float]) -> None:
    """One line per fault at the moment of its detection, and its freeze frame as a page."""
    words = HINT if diagnosis.faults else "No fault was detected."
    stream.set_time("time", duration=np.timedelta64(0, "ns"))
    stream.log("fault/freeze_frame", rr.TextDocument(words, media_type=rr.MediaType.MARKDOWN))
    for fault in diagnosis.faults:
        at = starts[fault.drive] + fault.first_detected_s
        stream.set_time("time", duration=np.timedelta64(round(at * 1e9), "ns"))
        stream.log("fault/log", rr.TextLog(f"{headline(fault)}; {details(fault)}", level="ERROR"))
        frame = freeze_frame(fault, diagnosis.run.vehicle.machine)
        page = rr.TextDocument(frame, media_type=rr.MediaType.MARKDOWN)
        stream.log("fault/freeze_frame", page)
        stream.log(f"{entity(fault.fault)}/freeze_frame", page)
    stream.reset_time()
