"""Replay: signals of one or more drives in, estimates with their uncertainty out."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from clutchest import __version__
from clutchest.errors import ClutchestError
from clutchest.estimate.run import Run
from clutchest.estimate.smooth import smoothed
from clutchest.estimate.start import History, carried_on, fresh, leave
from clutchest.estimate.summary import Part, summarise
from clutchest.estimate.timeline import build
from clutchest.estimate.track import states_of, track_of
from clutchest.estimate.whole_log import Compiled, Progress, compile_model, delays, run
from clutchest.models import model_for
from clutchest.signals import Signals
from clutchest.vehicle import Vehicle, load_vehicle

FASTEST = 1000.0  # Hz, of the output grid


def replay(
    signals: Signals,
    vehicle: Vehicle | str | Path,
    *,
    rate: float = 10.0,
    state: Mapping[str, Any] | None = None,
    smooth: bool = False,
    progress: Progress | None = None,
) -> Run:
    """Estimate temperatures, wear, friction and torque over every drive in ``signals``.

    ``vehicle`` as loaded, or what ``load_vehicle`` takes.
    ``rate`` Hz of the output grid; ``state`` as an earlier run's ``Run.final``, carried over the
    time in between; with ``smooth`` also what each whole drive tells of the states at every time;
    ``progress`` is called with a text and the share done.  Raises ClutchestError where a signal
    that the model needs is not there.
    """
    vehicle = load_vehicle(vehicle)
    if not 0.0 < rate <= FASTEST:
        raise ClutchestError(f"rate {rate:g} Hz: expected more than 0, at most {FASTEST:g}")
    tracks, parts, digest = [], [], ""
    for drive in signals.drives:
        usable = {name for name in drive if drive[name].valid.any()}
        model = model_for(vehicle.model, usable)
        compiled = compile_model(vehicle, model, progress=progress)
        timeline = build(drive, vehicle, compiled.model, rate, delays(vehicle))
        warnings = list(timeline.warnings)
        warnings += left_out(vehicle, compiled)
        if state is None:
            start = fresh(vehicle, compiled, timeline)
        else:
            start, warning = carried_on(vehicle, compiled, timeline, state, drive.start_ns)
            warnings += [warning] if warning else []
        filtered = run(compiled, timeline, start, consider=True, progress=progress)
        track = track_of(vehicle, compiled, timeline, filtered)
        if smooth:
            over = smoothed(compiled, timeline, start, filtered, progress)
            track = replace(track, smoothed=states_of(vehicle, compiled, over.x, over.variance))
        history = History.of(state).after(
            float(timeline.t[-1] - timeline.t[0]),
            len(track.engagements),
            max(float(filtered.final.E[0] - start.E[0]), 0.0),
        )
        state = leave(vehicle, compiled, timeline, filtered.final, drive.start_ns, history)
        tracks.append(track)
        parts.append(Part(drive, compiled, timeline, filtered, warnings, history))
        digest = compiled.digest
    assert state is not None  # a log has at least one drive
    return Run(
        vehicle=vehicle,
        signals=signals,
        tracks=tuple(tracks),
        summary=summarise(vehicle, tracks, parts),
        final=state,
        provenance=provenance(vehicle, digest),
    )


def left_out(vehicle: Vehicle, compiled: Compiled) -> list[str]:
    """A warning where effects of the vehicle file are not in the model."""
    present = {effect.name for effect in compiled.model.effects}
    names = [name for name in vehicle.effects if name not in present]
    return [f"without {', '.join(names)}: the signals at hand do not show it"] if names else []


def provenance(vehicle: Vehicle, digest: str) -> dict[str, str]:
    """Versions, and hashes of vehicle, parameters and compiled model."""
    from importlib.metadata import version

    numbers = repr(sorted((k, v.value, v.spread) for k, v in vehicle.parameters.items()))
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
