"""The summary of a replay: what ``summary.json`` says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from math import isfinite
from typing import Any

import numpy as np

from clutchest.estimate.modes import MODE_NAMES
from clutchest.estimate.run import Track
from clutchest.estimate.start import prior_std
from clutchest.estimate.timeline import Timeline
from clutchest.estimate.whole_log import Compiled, Filtered
from clutchest.models.symbols import State
from clutchest.signals import Floats, Signals
from clutchest.vehicle import Vehicle

INFORMED = 1e-3  # share of a variance that must fall between two outputs to count
Part = tuple[Signals, Compiled, Timeline, Filtered, list[str]]


def summarise(vehicle: Vehicle, tracks: Sequence[Track], parts: Sequence[Part]) -> dict[str, Any]:
    """Counts, final states, sensors, engagements and warnings over all drives."""
    rejected: dict[str, int] = {}
    messages: dict[str, dict[str, int]] = {}
    warnings: list[str] = []
    for number, (drive, *_, own) in enumerate(parts):
        for reason, count in drive.counts.rejected.items():
            rejected[reason] = rejected.get(reason, 0) + count
        for message, counts in drive.counts.messages.items():
            total = messages.setdefault(message, {})
            for reason, count in counts.items():
                total[reason] = total.get(reason, 0) + count
        prefix = f"drive {number}: " if len(parts) > 1 else ""
        warnings += [prefix + warning for warning in (*drive.warnings, *own)]
    if vehicle.guessed:
        every = len(vehicle.guessed) == len(vehicle.parameters)
        names = f"all {len(vehicle.guessed)}" if every else ", ".join(vehicle.guessed)
        warnings.append(f"guessed parameters, by {vehicle.path.name}: {names}")
    last, (_, compiled, timeline, filtered, _) = tracks[-1], parts[-1]
    return {
        "vehicle": vehicle.name,
        "frames": sum(p[0].counts.frames for p in parts),
        "frames_decoded": sum(p[0].counts.decoded for p in parts),
        "frames_rejected": rejected,
        "messages": messages,
        "duration_s": float(sum(p[2].t[-1] - p[2].t[0] for p in parts)),
        "drives": len(tracks),
        "modes_s": _modes(tracks),
        "states": {
            state.name: _state(vehicle, compiled, timeline, filtered, last, i)
            for i, state in enumerate(compiled.model.states)
        },
        "sensors": _sensors(tracks),
        "engagements": [
            {"drive": number, **asdict(engagement)}
            for number, track in enumerate(tracks)
            for engagement in track.engagements
        ],
        "slip_energy_J": _number(last.slip_energy.value),
        "slip_energy_std_J": _number(last.slip_energy.std),
        "guessed_parameters": list(vehicle.guessed),
        "log_likelihood": float(sum(track.log_likelihood for track in tracks)),
        "warnings": warnings,
    }


def _number(column: Floats) -> float | None:
    """The last value, None where there is none."""
    return float(column[-1]) if len(column) and isfinite(column[-1]) else None


def _modes(tracks: Sequence[Track]) -> dict[str, float]:
    """Seconds spent in each mode."""
    spent = dict.fromkeys(MODE_NAMES, 0.0)
    for track in tracks:
        if len(track.time) > 1:
            step = float(np.median(np.diff(track.time)))
            for code, name in enumerate(track.mode_names):
                spent[name] += step * float(np.sum(track.mode == code))
    return spent


def _state(
    vehicle: Vehicle,
    compiled: Compiled,
    timeline: Timeline,
    filtered: Filtered,
    track: Track,
    i: int,
) -> dict[str, Any]:
    """Final value, standard deviation, whether to trust it and, if not, why."""
    state = compiled.model.states[i]
    estimate = track.states[state.name]
    value, std = float(estimate.value[-1]), float(estimate.std[-1])
    valid = bool(estimate.valid[-1])
    why = None
    if not valid:
        why = compiled.model.unobservable.get(state.name) or _too_wide(
            state, std, float(np.sqrt(filtered.P[-1, i, i])), prior_std(vehicle, compiled)[i]
        )
    return {
        "value": value if isfinite(value) else None,
        "std": std if isfinite(std) else None,
        "unit": state.unit,
        "valid": valid,
        "why": why,
        "informed_at_s": _informed(timeline, filtered, i),
    }


def _too_wide(state: State, std: float, own: float, prior: float) -> str:
    """Why a standard deviation is too large to be of use."""
    if own >= 0.98 * prior:
        return f"nothing in this log informs it; it needs {state.informed_by}"
    if std > 1.5 * own:
        return f"±{std:.2g} {state.unit}, most of it from the spread of the parameters"
    return f"±{std:.2g} {state.unit} is too wide to be of use; it needs {state.informed_by}"


def _informed(timeline: Timeline, filtered: Filtered, i: int) -> float | None:
    """The last output time before which measurements lowered the state's variance by 0.1 %."""
    gained = np.flatnonzero(np.diff(filtered.gained[:, i]) > INFORMED)
    if not len(gained):
        return None
    rows = np.flatnonzero(timeline.emit >= 0)
    return float(timeline.t[rows[gained[-1] + 1]])


def _sensors(tracks: Sequence[Track]) -> dict[str, dict[str, Any]]:
    """Per sensor: samples, root mean square of the innovation, mean normalised square."""
    found: dict[str, dict[str, Any]] = {}
    names = dict.fromkeys(name for track in tracks for name in track.innovations.names)
    for name in names:
        parts = [t.innovations.of(name) for t in tracks if name in t.innovations.names]
        innovation = np.concatenate([p[1] for p in parts])
        std = np.concatenate([p[2] for p in parts])
        count = len(innovation)
        found[name] = {
            "count": count,
            "innovation_rms": float(np.sqrt(np.mean(innovation**2))) if count else None,
            "nis_mean": float(np.mean((innovation / std) ** 2)) if count else None,
        }
    return found
