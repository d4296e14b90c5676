"""How the output followed each actuation, as a table, and how it judders, in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from clutchest.estimate.run import Run, TrackingFigures

FIGURES = (
    ("delay_s", "delay [ms]", 1e3),
    ("rise_s", "rise [ms]", 1e3),
    ("overshoot", "overshoot [%]", 1e2),
    ("settling_s", "settling [ms]", 1e3),
    ("settled", "settled [{unit}]", 1.0),
    ("error", "error [{unit}]", 1.0),
    ("ripple", "ripple [{unit}]", 1.0),
    ("fall_s", "release [ms]", 1e3),
)  # field, heading, factor


def tracking_head(run: Run) -> tuple[str, ...]:
    """Headings of the table; empty where the machine declares no tracking."""
    tracking = run.vehicle.machine.tracking
    if tracking is None:
        return ()
    drive = ("drive",) if len(run.tracks) > 1 else ()
    return (*drive, "start [s]", *(words.format(unit=tracking.unit) for _, words, _ in FIGURES))


def tracking_rows(run: Run) -> list[tuple[str, ...]]:
    """One row per actuation, a dash for what the data do not give."""
    rows = []
    for number, track in enumerate(run.tracks):
        drive = (str(number),) if len(run.tracks) > 1 else ()
        rows += [(*drive, f"{r.start_s:.2f}", *_cells(r)) for r in track.responses]
    return rows


def tracking_note(run: Run) -> str:
    """What the figures are of, and what is missing for the others."""
    tracking, found = run.vehicle.machine.tracking, [r for t in run.tracks for r in t.responses]
    if tracking is None or not found:
        return ""
    every = max(response.resolution_s for response in found)
    words = f"From the measured output, a sample every {1e3 * every:.3g} ms."
    if not all(response.measured for response in found):
        words = f"From the estimated output, every {1e3 * every:.3g} ms (--rate raises that)."
    if tracking.request and all(response.error is None for response in found):
        words += f" No error: {tracking.request} is not mapped."
    return words


def judder_words(run: Run) -> list[str]:
    """The line of every drive that judders, in a sentence."""
    declared, words = run.vehicle.machine.judder, []
    for number, track in enumerate(run.tracks):
        if declared is not None and track.judder is not None:
            drive = f"drive {number}: " if len(run.tracks) > 1 else ""
            words.append(drive + track.judder.words(declared.unit))
    return words


def figures_in_words(figures: Mapping[str, Any]) -> str:
    """Figures of one actuation, named as in files, those that the data give."""
    words = []
    for name, heading, factor in FIGURES:
        key = next(key for key in figures if key == name or key.startswith(f"{name}_"))
        if figures[key] is not None:
            what, _, unit = heading.format(unit=key.removeprefix(f"{name}_")).partition(" [")
            words.append(f"{what} {factor * figures[key]:.0f} {unit.removesuffix(']')}")
    return ", ".join(words) or "no response"


def _cells(response: TrackingFigures) -> Sequence[str]:
    values = ((getattr(response, name), factor) for name, _, factor in FIGURES)
    return ["–" if value is None else f"{factor * value:.0f}" for value, factor in values]
