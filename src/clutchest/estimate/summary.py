"""The summary of a replay: what ``summary.json`` says."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import asdict, dataclass
from math import isfinite
from typing import Any

import numpy as np

from clutchest import memory_mapped
from clutchest.estimate.guesses import energy_std_from, guesses, uncertain_slips
from clutchest.estimate.initial_state import History
from clutchest.estimate.observability import (
    NOTHING,
    ByMode,
    between_engagements,
    correlated_with,
    needs,
    not_observable_now,
    strong_correlations,
)
from clutchest.estimate.run import Engagement, Track
from clutchest.estimate.tracking import during
from clutchest.estimate.wear import wear_trend
from clutchest.estimate.whole_log import Belief, Compiled
from clutchest.models.symbols import State
from clutchest.shown import with_unit
from clutchest.signals import Counts, Floats, Signal, Signals
from clutchest.vehicle import Vehicle


@dataclass(frozen=True, slots=True)
class Part:
    """What the summary needs of one drive beside its track: ``span_s`` from its first event to the
    last, ``final`` belief, at the last row the variance (n) that is the filter's ``own``, without
    the parameters' share, and ``history`` with this drive."""

    drive: Signals
    compiled: Compiled
    span_s: float
    final: Belief
    own: Floats
    warnings: list[str]
    history: History


def summarise(
    vehicle: Vehicle,
    tracks: Sequence[Track],
    parts: Sequence[Part],
    carried: Container[str] = (),
) -> dict[str, Any]:
    """Counts, final states, sensors, engagements and warnings over all drives; ``carried``: states
    that begin as a drive before these left them."""
    counts = sum((part.drive.counts for part in parts), Counts())
    warnings: list[str] = []
    for number, part in enumerate(parts):
        drive = part.drive
        prefix = f"drive {number}: " if len(parts) > 1 else ""
        warnings += [prefix + warning for warning in (*drive.warnings, *part.warnings)]
    end, believed = parts[-1], not tracks[-1].contradiction
    energy_from = energy_std_from(end.compiled, end.final) if believed else {}
    uncertain = [slip for track in tracks for slip in track.uncertain_slips]
    warnings += [*uncertain_slips(uncertain), *guesses(vehicle, energy_from), *vehicle.notes]
    energy = tracks[-1].slip_energy if believed else None
    trend = wear_trend(vehicle, end.compiled, end.final, end.history) if believed else None
    return {
        "vehicle": vehicle.name,
        "contradiction": _contradiction(tracks),
        **counts.summary(),
        "messages": counts.messages,
        "duration_s": float(sum(p.span_s for p in parts)),
        "drives": len(tracks),
        "modes_s": _modes(tracks),
        "states": _states(vehicle, tracks, end, carried),
        "wear": trend,
        "sensors": _sensors(tracks),
        "engagements": _engagements(vehicle, tracks, parts),
        "tracking": _tracking(vehicle, tracks),
        "judder": _judder(vehicle, tracks),
        "between_engagements": [
            {"drive": number, **piece}
            for number, track in enumerate(tracks)
            for piece in between_engagements(
                track.information,
                [(e.start_s, e.start_s + e.duration_s) for e in track.engagements],
            )
        ],
        "slip_energy_J": _number(energy.value if energy else None),
        "slip_energy_std_J": _number(energy.std if energy else None),
        "slip_energy_std_from_J": energy_from,
        "uncertain_slips": [
            {"drive": number, **asdict(event)}
            for number, track in enumerate(tracks)
            for event in track.uncertain_slips
        ],
        "guessed_parameters": list(vehicle.guessed),
        "log_likelihood": float(sum(track.log_likelihood for track in tracks)),
        "warnings": warnings,
    }


def _engagements(
    vehicle: Vehicle, tracks: Sequence[Track], parts: Sequence[Part]
) -> list[dict[str, Any]]:
    """Slip events, each with its peak slip and gear, and the figures of its actuation where the
    machine declares some."""
    tracking, entries = vehicle.machine.tracking, []
    names = vehicle.machine.event.slip if vehicle.machine.event else ()
    for number, track in enumerate(tracks):
        drive = parts[number].drive
        slip = [drive[name].only_valid() for name in names if name in drive]
        slip = slip if len(slip) == len(names) else []
        events = [
            {
                "drive": number,
                **asdict(event),
                "peak_slip": _peak_slip(slip, event),
                **_gear(drive, event),
            }
            for event in track.engagements
        ]
        if tracking is not None:
            figures = during(track.engagements, track.responses, tracking.unit)
            events = [{**event, **more} for event, more in zip(events, figures, strict=True)]
        entries += events
    return entries


def _peak_slip(signals: Sequence[Signal], event: Engagement) -> float | None:
    """The largest slip in an event, rad/s, single spikes left out, by the valid samples of its
    signals; None without these."""
    start, end = event.start_s, event.start_s + event.duration_s
    if not signals or any(len(signal) == 0 for signal in signals):
        return None
    first, *other = signals
    a, b = np.searchsorted(first.time, start), np.searchsorted(first.time, end, side="right")
    if b - a < 3:
        return None
    time, slip = first.time[a:b], first.value[a:b]
    for signal in other:
        a, b = np.searchsorted(signal.time, start, side="right"), np.searchsorted(signal.time, end)
        slip = slip - signal.take(slice(max(a - 1, 0), b + 1)).at(time)
    before, at, after = slip[:-2], slip[1:-1], slip[2:]
    low, high = np.minimum(before, at), np.maximum(before, at)
    middle = np.maximum(low, np.minimum(high, after))  # of three: np.median takes longer
    return float(np.abs(middle).max())


def _gear(drive: Signals, event: Engagement) -> dict[str, int | None]:
    """The gear in which an event ends, where the drive has gears."""
    if drive.gear is None:
        return {}
    gear = drive.gear.only_valid().at(np.array([event.start_s + event.duration_s]))[0]
    return {"gear": round(float(gear)) if isfinite(gear) else None}


def _tracking(vehicle: Vehicle, tracks: Sequence[Track]) -> list[dict[str, Any]] | None:
    """Every actuation and how the output followed; None of a machine that declares no tracking."""
    tracking = vehicle.machine.tracking
    if tracking is None:
        return None
    return [
        {"drive": number, **response.figures(tracking.unit)}
        for number, track in enumerate(tracks)
        for response in track.responses
    ]


def _judder(vehicle: Vehicle, tracks: Sequence[Track]) -> list[dict[str, Any]] | None:
    """The line of every drive that judders; None of a machine that declares no judder."""
    declared = vehicle.machine.judder
    if declared is None:
        return None
    return [
        {"drive": number, **track.judder.figures(declared.unit)}
        for number, track in enumerate(tracks)
        if track.judder is not None
    ]


def _contradiction(tracks: Sequence[Track]) -> dict[str, Any] | None:
    """The first drive in which signals and model contradict each other."""
    for number, track in enumerate(tracks):
        if found := track.contradiction:
            return {
                "words": found.words,
                "explanation": found.explanation,
                "signal": found.signal,
                "drive": number,
                "since_s": found.since_s,
            }
    return None


def _number(column: Floats | None) -> float | None:
    """The last value, None where there is none."""
    if column is None or not len(column):
        return None
    return float(column[-1]) if isfinite(column[-1]) else None


def _modes(tracks: Sequence[Track]) -> dict[str, float]:
    """Seconds spent in each mode."""
    spent = dict.fromkeys(tracks[0].mode_names, 0.0)
    for track in tracks:
        if len(track.time) > 1:
            step = float(np.median(np.diff(track.time)))
            for code, name in enumerate(track.mode_names):
                spent[name] += step * float(np.sum(track.mode == code))
    return spent


def _states(
    vehicle: Vehicle, tracks: Sequence[Track], part: Part, carried: Container[str]
) -> dict[str, dict[str, Any]]:
    """Final values, standard deviations, whether they are valid, and what would improve them."""
    model, track = part.compiled.model, tracks[-1]
    together = strong_correlations(part.compiled, part.final)
    informed = [track.information.by_mode() for track in tracks]
    states = {}
    for i, state in enumerate(model.states):
        estimate = track.states[state.name]
        value, std = float(estimate.value[-1]), float(estimate.std[-1])
        valid = bool(estimate.valid[-1])
        entry: dict[str, Any] = {
            "value": value if isfinite(value) else None,
            "std": std if isfinite(std) else None,
            "unit": state.unit,
            "valid": valid,
            "carried_over": state.name in carried,
        }
        if state.name in model.unobservable:
            why = model.unobservable[state.name]
            entry |= {
                "why": why,
                "needs": "the missing signal",
                "information_bits": None,
                "informed_at_s": None,
                "not_observable_now": why,
                "moves_with": {},
            }
        else:
            bits = _bits(informed, state.name)
            partners = together[state.name]
            own = float(np.sqrt(part.own[i]))
            reason, what = _distrusted(track, state, value), None
            if not valid and reason is None:
                reason = _too_wide(state, std, own, bits["total"], partners)
                what = needs(vehicle.machine, state, partners)
            entry |= {
                "why": None if valid else reason,
                "needs": what,
                "information_bits": bits,
                "informed_at_s": track.information.informed_at(state.name),
                "not_observable_now": not_observable_now(
                    track.information, informed[-1], state.name
                ),
                "moves_with": partners,
            }
        states[state.name] = entry
    return states


def _bits(informed: Sequence[ByMode], name: str) -> dict[str, float]:
    """Information of measurements about a state over all drives, in all and by mode."""
    modes = {
        mode: sum(drive[mode][name] for drive in informed if name in drive[mode])
        for mode in informed[0]
    }
    return {"total": sum(modes.values()), **modes}


def _distrusted(track: Track, state: State, value: float) -> str | None:
    """Why a value is not believed, however narrow it is."""
    if track.contradiction:
        return f"signals and model contradict each other: {track.contradiction.words}"
    low, high = state.possible
    return None if low <= value <= high else "the value is physically impossible"


def _too_wide(
    state: State, std: float, own: float, bits: float, partners: Mapping[str, float]
) -> str:
    """Why a standard deviation is too large to be of use."""
    if bits < NOTHING:
        return "nothing in this log informs it"
    if together := correlated_with(partners):
        return together
    wide = f"±{with_unit(f'{std:.2g}', state.unit)}"
    if std > 1.5 * own:
        return f"{wide}, most of it from the spread of the parameters"
    return f"{wide} is too wide to be of use"


def _sensors(tracks: Sequence[Track]) -> dict[str, dict[str, Any]]:
    """Per sensor: samples, root mean square of the innovation, mean normalised square."""
    sensors: dict[str, dict[str, Any]] = {}
    names = dict.fromkeys(name for track in tracks for name in track.innovations.names)
    for name in names:
        count, squares, judged = 0, 0.0, 0.0
        for track in tracks:
            if name not in track.innovations.names:
                continue
            _, innovation, std = track.innovations.of(name)
            count += len(innovation)
            for rows in memory_mapped.portions(len(innovation)):
                misfit = innovation[rows]
                squares += float(np.sum(misfit**2))
                judged += float(np.sum((misfit / std[rows]) ** 2))
        sensors[name] = {
            "count": count,
            "innovation_rms": float(np.sqrt(squares / count)) if count else None,
            "nis_mean": judged / count if count else None,
        }
    return sensors
