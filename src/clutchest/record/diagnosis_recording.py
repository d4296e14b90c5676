"""A diagnosis in a run's recording: a lane per monitor, a log, and a freeze frame per fault."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr

from clutchest.diagnosis.result import Diagnosis, Fault
from clutchest.record.diagnosis import details, headline
from clutchest.record.quantities import Quantity

COLOURS = {"passed": 0x2F5D50FF, "failed": 0xE4572EFF}
MOST_LANES = 8  # more would be too thin to read
HINT = "Click the time of a fault above: what was known then stands here."


def lanes_of(diagnosis: Diagnosis) -> dict[str, tuple[tuple[tuple[float, str], ...], ...]]:
    """Lanes worth a look: monitors that failed, then those of the clutch itself."""
    failed = {m.name for m in diagnosis.monitors if m.status == "failed"}
    names = sorted(diagnosis.lanes, key=lambda n: (n not in failed, ":" in n))
    return {name: diagnosis.lanes[name] for name in names[:MOST_LANES]}


def entity(name: str) -> str:
    """Where a fault's things stand in the recording."""
    return f"fault/{name.replace(':', '/')}"


def send_log(stream: rr.RecordingStream, diagnosis: Diagnosis, starts: Sequence[float]) -> None:
    """One line per fault at the moment it was found, and its freeze frame as a page."""
    words = HINT if diagnosis.faults else "No fault was found."
    stream.set_time("time", duration=np.timedelta64(0, "ns"))
    stream.log("fault/freeze_frame", rr.TextDocument(words, media_type=rr.MediaType.MARKDOWN))
    for fault in diagnosis.faults:
        at = starts[fault.drive] + fault.first_detected_s
        stream.set_time("time", duration=np.timedelta64(round(at * 1e9), "ns"))
        stream.log("fault/log", rr.TextLog(f"{headline(fault)}; {details(fault)}", level="ERROR"))
        page = rr.TextDocument(freeze_frame(fault), media_type=rr.MediaType.MARKDOWN)
        stream.log("fault/freeze_frame", page)
        stream.log(f"{entity(fault.fault)}/freeze_frame", page)
    stream.reset_time()


def freeze_frame(fault: Fault) -> str:
    """State, inputs and ranked causes at the moment of detection, as Markdown."""
    frame = fault.freeze_frame
    lines = [
        f"## {headline(fault)}",
        "",
        details(fault),
        "",
        f"At {frame['time']:.1f} s, mode **{frame['mode']}**:",
        "",
        "| state | value ± 1σ |",
        "|---|---|",
    ]
    for name, state in frame["states"].items():
        told = f"{state['value']:.4g} ± {state['std']:.2g}" if state["valid"] else "not known"
        lines.append(f"| {Quantity(name, '1').words} | {told} |")
    lines += ["", "| signal | value |", "|---|---|"]
    for name, value in frame["inputs"].items():
        lines.append(f"| {name} | {'–' if value is None else f'{value:.6g}'} |")
    if fault.causes:
        lines += ["", "| cause | size ± 1σ | explains less by, −2 ln p |", "|---|---|---|"]
        lines += [
            f"| {c.fault} | {c.size:+.3g} ± {c.std:.2g} {c.unit} | {c.behind:.1f} |"
            for c in fault.causes
        ]
    return "\n".join(lines) + "\n"
