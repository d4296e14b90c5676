"""Replay: signals of one or more drives in, estimates with their uncertainty out."""

from __future__ import annotations

import hashlib
import platform
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from clutchest import __version__, memory_mapped
from clutchest.checked import checked
from clutchest.errors import ClutchestError
from clutchest.estimate.consistency import Consistency, all_invalid
from clutchest.estimate.contradiction import Contradiction
from clutchest.estimate.delay_equalisation import evenly_late
from clutchest.estimate.doubts import doubts
from clutchest.estimate.drive import Drive, Stretch, begun
from clutchest.estimate.drive_setup import Unusable, timings_of, warnings_of
from clutchest.estimate.engines import KERNEL, filter_of
from clutchest.estimate.explanation import explained
from clutchest.estimate.impossible import impossible
from clutchest.estimate.initial_state import History, carried_states, contradicted, leave
from clutchest.estimate.judder import judder
from clutchest.estimate.judder_line import JudderLine
from clutchest.estimate.other_bench import on_other_bench
from clutchest.estimate.run import Run, Track, TrackingFigures
from clutchest.estimate.summary import Part, summarise
from clutchest.estimate.timeline import build
from clutchest.estimate.track import joined, states_of, track_of
from clutchest.estimate.tracking import responses
from clutchest.estimate.whole_log import compile_model, delays
from clutchest.estimate.worn import as_found
from clutchest.made_ahead import made_ahead
from clutchest.patient_loading import at_work
from clutchest.progress import Progress
from clutchest.reading import Logs, as_signals
from clutchest.signals import HEAD, Signal, Signals
from clutchest.vehicle import Vehicle, load_vehicle

SHORTEST, STRETCH = 150.0, 600.0  # s that are filtered together
TOGETHER = 8  # stretches whose estimates are put away together
FASTEST = 1000.0  # Hz, of the output grid


@checked
def replay(
    signals: Signals | Logs,
    vehicle: Vehicle | str | Path,
    *,
    rate: float = 10.0,
    state: Mapping[str, Any] | None = None,
    smooth: bool = False,
    engine: str = KERNEL,
    progress: Progress | None = None,
) -> Run:
    """Estimate temperatures, wear, friction and torque over every drive in ``signals``.

    ``signals`` as read, or what ``read_log`` takes; ``vehicle`` as loaded, or what ``load_vehicle``
    takes.
    ``rate`` Hz of the output grid; ``state`` as an earlier run's ``Run.final``, carried over the
    time in between; with ``smooth`` also what each whole drive tells of the states at every time;
    ``engine``: the filter, ``kernel`` or ``filterpy``, which give the same and the latter some
    hundred times as slowly; ``progress`` is called with a text and the share done.  Drives that
    lack a signal which the model needs are left out with a warning.  Raises ClutchestError where
    all of them do.
    """
    vehicle = load_vehicle(vehicle)
    signals = as_signals(signals, vehicle)
    if not 0.0 < rate <= FASTEST:
        raise ClutchestError(f"rate {rate} Hz: expected more than 0, at most {FASTEST:g}")
    tracks, parts, before = [], [], state
    unusable: list[tuple[Signals, Unusable]] = []
    estimate = _whole if smooth else _in_stretches
    for drive in signals.drives:
        try:
            track, part, state = _best(estimate, drive, vehicle, rate, state, engine, progress)
        except Unusable as problem:
            unusable.append((drive, problem))
            continue
        found = _contradiction(drive, track, part, vehicle, progress)
        if found is not None:
            track, state = all_invalid(track, found), contradicted(dict(state), found)
        followed, line = _followed(drive, track, vehicle), _judder(drive, track, vehicle)
        tracks.append(replace(track, responses=followed, judder=line))
        said = doubts(drive, track, part.compiled.model, vehicle)
        parts.append(replace(part, warnings=[*part.warnings, *said]))
    if not tracks:
        raise unusable[0][1]
    if unusable:
        first = _beside(parts[0].drive, unusable)
        parts[0] = replace(parts[0], drive=first)
        signals = replace(first, later=tuple(part.drive for part in parts[1:]))
    assert state is not None  # a log has at least one drive
    return Run(
        vehicle=vehicle,
        signals=signals,
        tracks=tuple(tracks),
        summary=summarise(vehicle, tracks, parts, carried_states(parts[0].compiled.model, before)),
        final=state,
        provenance=provenance(vehicle, parts[-1].compiled.digest),
    )


Estimated = tuple[Track, Part, Mapping[str, Any]]


def _best(
    estimate: Callable[..., Estimated],
    drive: Signals,
    vehicle: Vehicle,
    rate: float,
    state: Mapping[str, Any] | None,
    engine: str,
    progress: Progress | None,
) -> Estimated:
    """One drive; where it begins with a new part and finds a worn one, once more from that, if it
    is more probable."""
    first = estimate(drive, vehicle, rate, state, engine, progress)
    new = state is None or bool(state.get("contradiction"))
    worn = as_found(vehicle, first[0]) if new else None
    if worn is None:
        return first
    second = estimate(drive, worn, rate, state, engine, progress)
    return second if second[0].log_likelihood > first[0].log_likelihood else first


def _contradiction(
    drive: Signals, track: Track, part: Part, vehicle: Vehicle, progress: Progress | None
) -> Contradiction | None:
    """Why signals and model cannot both be right, and what explains it; None where they may be."""
    if (elsewhere := on_other_bench(drive, vehicle)) is not None:
        return elsewhere
    found = explained(track.contradiction, track, part.drive, vehicle, progress)
    if found is not None and found.is_explained:
        return found
    return impossible(drive, vehicle) or found


def _followed(drive: Signals, track: Track, vehicle: Vehicle) -> tuple[TrackingFigures, ...]:
    """How the output followed; nothing on a bench without the parts between motor and output."""
    if track.contradiction and track.contradiction.kind == "bench":
        return ()
    noise = {name: mapped.noise for name, mapped in vehicle.signals.items()}
    return responses(drive, track, vehicle.machine.tracking, noise)


def _judder(drive: Signals, track: Track, vehicle: Vehicle) -> JudderLine | None:
    """The line that surfaces slide with, where signals and model agree."""
    if track.contradiction:
        return None
    numbers = {key: p.value for key, p in vehicle.parameters.items()}
    rate = vehicle.false_alarms_per_1000h
    return judder(vehicle.machine.judder, drive, track, numbers, rate)


def _beside(drive: Signals, unusable: Sequence[tuple[Signals, Unusable]]) -> Signals:
    """``drive`` with the frames of unusable stretches of the same logs counted, and a warning for
    each."""
    counts, warnings = drive.counts, list(drive.warnings)
    for other, problem in unusable:
        rejected = Counter(counts.rejected) + Counter(other.counts.rejected)
        if other.counts.decoded:
            rejected["in a stretch without what the model needs"] += other.counts.decoded
        counts = replace(
            counts, frames=counts.frames + other.counts.frames, rejected=dict(rejected)
        )
        begun = other.start_ns
        when = (
            "" if begun is None else f" from {datetime.fromtimestamp(begun / 1e9, UTC):%F %T} UTC"
        )
        warnings.append(f"a stretch of {other.end:.1f} s{when} is left out: {problem}")
    return replace(drive, counts=counts, warnings=tuple(warnings))


def _in_stretches(
    signals: Signals,
    vehicle: Vehicle,
    rate: float,
    state: Mapping[str, Any] | None,
    engine: str,
    progress: Progress | None,
) -> tuple[Track, Part, Mapping[str, Any]]:
    """One drive, stretch by stretch: what the filter needs and makes on its way takes no more
    memory in a longer log."""
    usable = {name: signal for name, signal in signals.items() if signal.valid.any()}
    drive = Drive(vehicle, usable, signals.start_ns, rate, state, progress, engine)
    timings_of(signals, drive.setting)  # raises where this log cannot be filtered
    latest = max(float(signal.time[np.argmax(signal.valid)]) for signal in usable.values())
    stops = _stops(latest + HEAD, signals.end - HEAD)
    tracks: list[Track] = []
    recent: list[Track] = []
    ready = _stretches(drive, usable, (*stops, np.inf), signals.end)
    with made_ahead(ready) as stretches, at_work():
        warnings = list(warnings_of(signals, drive.setting))
        for stretch in stretches:
            if progress:
                progress("filtering", max(float(stretch.line.t[0]), 0.0) / max(signals.end, 1e-9))
            piece = drive.filtered(stretch)
            recent.append(piece.track)
            warnings += piece.warnings
            if len(recent) == TOGETHER:
                tracks, recent = [*tracks, joined(recent)], []
            memory_mapped.release_memory()
    if progress:
        progress("filtering", 1.0)
    left = drive.final()
    assert left is not None and drive.belief is not None  # a drive has an event at its end
    part = Part(
        signals, drive.compiled, drive.span_s, drive.belief, drive.own, warnings, drive.past
    )
    return joined([*tracks, *recent]), part, left


def _stops(first: float, end: float) -> Iterator[float]:
    """Where stretches end, s, from ``first`` on and before ``end``: the filter waits for the first
    one, so they begin short."""
    stop, length = max(first, SHORTEST), SHORTEST
    while stop < end:
        yield stop
        length = min(2.0 * length, STRETCH)
        stop += length


def _stretches(
    drive: Drive, usable: Mapping[str, Signal], stops: Iterable[float], end: float
) -> Iterator[Stretch]:
    """The stretches of a drive up to each of ``stops``, s, the last one infinite; its signals
    ``end`` there."""
    done = -np.inf
    for stop in stops:
        last = stop == np.inf
        with at_work():
            new = {
                name: signal.take(slice(*np.searchsorted(signal.time, (done, stop))))
                for name, signal in usable.items()
            }
            stretch = drive.ready(new, dict.fromkeys(new, end if last else stop), last)
            memory_mapped.release_memory()
        if stretch is not None:
            yield stretch
        done = stop


def _whole(
    signals: Signals,
    vehicle: Vehicle,
    rate: float,
    state: Mapping[str, Any] | None,
    engine: str,
    progress: Progress | None,
) -> tuple[Track, Part, Mapping[str, Any]]:
    """One drive at once, since a smoother goes back over all of it."""
    from clutchest.estimate.smooth import smoothed  # not loaded by those who do without

    usable = signals.available
    compiled = compile_model(vehicle, vehicle.machine.equations(usable), progress=progress)
    even = evenly_late(signals, vehicle)
    timeline = build(even, vehicle, compiled.model, rate, delays(vehicle))
    start, warnings = begun(vehicle, compiled, timeline, state, signals.start_ns)
    filtered = filter_of(engine)(compiled, timeline, start, progress=progress)
    track = track_of(vehicle, compiled, timeline, filtered)
    track = Consistency.of(compiled.model, vehicle).take(track, last=True)
    over = smoothed(compiled, timeline, start, filtered, progress)
    track = replace(track, smoothed=states_of(vehicle, compiled, over.x, over.variance))
    span = float(timeline.t[-1] - timeline.t[0])
    history = History.of(state).after(
        span, len(track.engagements), max(float(filtered.final.E[0] - start.E[0]), 0.0)
    )
    part = Part(
        signals,
        compiled,
        span,
        filtered.final,
        filtered.P[-1].diagonal(),
        [*timeline.warnings, *warnings],
        history,
    )
    left = leave(vehicle, compiled, timeline, filtered.final, signals.start_ns, history)
    return track, part, left


def provenance(vehicle: Vehicle, digest: str) -> dict[str, str]:
    """Versions, and hashes of vehicle, parameters and compiled model."""
    from importlib.metadata import version

    numbers = repr(
        (
            sorted((k, v.value, v.spread) for k, v in vehicle.parameters.items()),
            vehicle.effect_numbers,
            vehicle.effect_spreads,
        )
    )
    return {
        "clutchest": __version__,
        "python": platform.python_version(),
        "numba": version("numba"),
        "casadi": version("casadi"),
        "vehicle": vehicle.name,
        "vehicle_hash": vehicle.hash,
        "parameters_hash": hashlib.sha256(numbers.encode()).hexdigest()[:16],
        "model_hash": digest,
    }
