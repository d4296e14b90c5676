"""Replay: signals of one or more drives in, estimates with their uncertainty out."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from clutchest import __version__
from clutchest.errors import ClutchestError
from clutchest.estimate.modes import MODE_NAMES, Mode, runs
from clutchest.estimate.observability import Information
from clutchest.estimate.run import Engagement, Estimate, Innovations, Run, Track
from clutchest.estimate.smooth import smoothed
from clutchest.estimate.start import History, carried_on, fresh, leave
from clutchest.estimate.summary import Part, summarise
from clutchest.estimate.timeline import Timeline, build
from clutchest.estimate.whole_log import (
    Compiled,
    Filtered,
    Progress,
    compile_model,
    delays,
    run,
)
from clutchest.models import model_for
from clutchest.signals import Floats, Signals
from clutchest.vehicle import Vehicle, load_vehicle

FASTEST = 1000.0  # Hz, of the output grid
TORQUE_FLOOR = 5.0  # Nm; a clutch that passes less counts as open
SLIDES = 0.98  # of the friction potential; surfaces that carry less are held by their bristles
SHORTEST = 0.1  # s; a slip event is longer than this
SMALLEST = 200.0  # J; and stronger than this and than its own uncertainty, or it is noise


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
        left_out = [name for name in vehicle.effects
                    if name not in {effect.name for effect in compiled.model.effects}]  # fmt: skip
        if left_out:
            warnings.append(f"without {', '.join(left_out)}: the signals at hand do not show it")
        if state is None:
            start = fresh(vehicle, compiled, timeline)
        else:
            start, warning = carried_on(vehicle, compiled, timeline, state, drive.start_ns)
            warnings += [warning] if warning else []
        filtered = run(compiled, timeline, start, consider=True, progress=progress)
        track = _track(vehicle, compiled, timeline, filtered)
        if smooth:
            over = smoothed(compiled, timeline, start, filtered, progress)
            track = replace(track, smoothed=_states(vehicle, compiled, over.x, over.variance))
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
        provenance=_provenance(vehicle, digest),
    )


def _track(vehicle: Vehicle, compiled: Compiled, timeline: Timeline, filtered: Filtered) -> Track:
    """The kernel's rows as named estimates, on the regular grid."""
    model = compiled.model
    rows = np.flatnonzero(timeline.emit >= 0)
    time, mode = timeline.t[rows], timeline.mode[rows].copy()
    torque = filtered.outputs[:, model.outputs.index("transmitted_torque")]
    idle = np.abs(torque[:, 0]) < TORQUE_FLOOR
    if "friction_potential" in model.outputs:  # what the surfaces could carry, and whether they do
        potential = filtered.outputs[:, model.outputs.index("friction_potential"), 0]
        carried = np.abs(torque[:, 0]) > SLIDES * potential
        known = mode != Mode.unknown
        pressed = np.where(carried, Mode.slipping, Mode.locked)
        mode[known] = np.where(potential < TORQUE_FLOOR, Mode.open, pressed)[known]
    elif "slave_position" in {i.name for i in model.inputs}:
        # pressed together or not is the model's word: the kiss point moves with heat and wear
        apart = mode <= Mode.slipping
        mode[apart] = np.where(idle[apart], Mode.open, Mode.slipping)
    information = Information.of(compiled, time, mode, filtered.gained)
    grid = timeline.grid
    sensed = timeline.sensor >= 0
    return Track(
        time=time[grid],
        mode=mode[grid],
        mode_names=MODE_NAMES,
        states=_states(vehicle, compiled, filtered.x[grid], filtered.total[grid]),
        clutch_torque=_estimate(torque[grid, 0], torque[grid, 1]),
        slip_energy=_estimate(
            filtered.energy[grid, 0],
            filtered.energy[grid, 1],
            "slip_energy" not in model.unobservable,
        ),
        innovations=Innovations(
            tuple(sensor.name for sensor in model.sensors),
            timeline.t[sensed],
            timeline.sensor[sensed],
            filtered.innovation[sensed, 0],
            np.sqrt(filtered.innovation[sensed, 1]),
        ),
        engagements=_engagements(compiled, information, torque[:, 0], filtered),
        log_likelihood=filtered.log_likelihood,
        information=information,
    )


def _states(
    vehicle: Vehicle, compiled: Compiled, x: Floats, variance: Floats
) -> dict[str, Estimate]:
    """Columns of ``x`` and ``variance`` (r, n) by name, and whether they are narrow enough."""
    states = {}
    for i, state in enumerate(compiled.model.states):
        std = np.sqrt(variance[:, i])
        useful = vehicle.estimation.get(state.name, state).useful_std
        if state.name in compiled.model.unobservable:  # a prior is no estimate
            nothing = np.full(len(std), np.nan)
            states[state.name] = Estimate(nothing, nothing, np.zeros(len(std), bool))
        else:
            states[state.name] = Estimate(x[:, i], std, std <= useful)
    return states


def _estimate(value: Floats, variance: Floats, known: bool = True) -> Estimate:
    valid = np.isfinite(value) & known
    std = np.sqrt(np.maximum(variance, 0.0))
    return Estimate(np.where(valid, value, np.nan), np.where(valid, std, np.nan), valid)


def _engagements(
    compiled: Compiled, information: Information, torque: Floats, filtered: Filtered
) -> tuple[Engagement, ...]:
    """Slip events: runs of rows in which the clutch slips and passes torque."""
    time, mode = information.time, information.mode
    hottest = compiled.model.state(compiled.model.hottest)
    found = []
    for a, b in zip(*runs(mode == Mode.slipping), strict=True):
        first, last = max(int(a) - 1, 0), min(int(b), len(time) - 1)
        gained = filtered.energy[last] - filtered.energy[first]
        duration = time[last] - time[first]
        # the parameters' share of the variance from the difference of the energy's responses
        variance = max(gained[2], 0.0) + float(np.sum((gained[3:] * compiled.spread) ** 2))
        if duration < SHORTEST or gained[0] < max(SMALLEST, np.sqrt(variance)):
            continue
        passed = torque[int(a) : int(b)]
        found.append(
            Engagement(
                start_s=float(time[first]),
                duration_s=float(duration),
                energy_J=float(gained[0]),
                energy_std_J=float(np.sqrt(variance)),
                peak_torque=float(passed[np.argmax(np.abs(passed))]),
                peak_temp_disc=float(filtered.x[first : last + 1, hottest].max()),
                information_bits=information.between(time[first], time[last]).total(),
            )
        )
    return tuple(found)


def _provenance(vehicle: Vehicle, digest: str) -> dict[str, str]:
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
