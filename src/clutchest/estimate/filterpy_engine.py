"""filterpy's filter over whole timelines, and in the hands of a user."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from clutchest.checked import checked
from clutchest.compute.records import Belief, RowResults
from clutchest.estimate.delay_equalisation import evenly_late
from clutchest.estimate.drive_setup import DriveSetup
from clutchest.estimate.ekf import OnlineFilter
from clutchest.estimate.initial_state import fresh
from clutchest.estimate.samples import white_density
from clutchest.estimate.timeline import Timeline, build
from clutchest.estimate.whole_log import (
    Compiled,
    Filtered,
    compile_model,
    delays,
    empty_rows,
    require_finite,
)
from clutchest.progress import Progress
from clutchest.reading import Logs, as_signals
from clutchest.signals import Floats, Signals
from clutchest.vehicle import Vehicle, load_vehicle

REPORT = 1000  # events between two reports of progress


def run_filterpy(
    compiled: Compiled,
    timeline: Timeline,
    start: Belief,
    *,
    gained: Floats | None = None,
    progress: Progress | None = None,
) -> Filtered:
    """What ``whole_log.run`` gives with ``CONSIDERING``, by filterpy's filter; ``signature`` and
    ``gains`` are empty."""
    engine = OnlineFilter(compiled, start, timeline, consider=True)
    gained = np.zeros((2, len(start.x))) if gained is None else gained
    rows, innovation, total = empty_rows(compiled, timeline), np.zeros((len(timeline.t), 3)), 0.0
    for k, row in enumerate(timeline.emit):
        if progress and k % REPORT == 0:
            progress("filtering", k / len(timeline.t))
        taken = engine.take(k)
        if taken is not None:
            innovation[k] = taken
            total += float(engine.log_likelihood)
            gained[1] += engine.K[: engine.states, 0] ** 2 * taken[2]
        if row >= 0:
            _store(rows, row, engine, timeline.u[k], timeline.row[k], gained)
    if progress:
        progress("filtering", 1.0)
    require_finite(engine.x)
    m, none = len(compiled.thetas), np.zeros((0, len(start.x)))
    return Filtered(*rows, innovation, np.zeros((0, m)), none, engine.belief(), total)


def _store(
    rows: RowResults, o: int, engine: OnlineFilter, u: Floats, row: int, gained: Floats
) -> None:
    """Row ``o`` of the output; ``gained`` (2, n) is brought up to it, in place."""
    n, now = engine.states, engine.belief()
    x, spread, P = now.x, engine.compiled.spread, engine.P
    total = np.diag(P)[:n]
    gained[0] += 0.5 * np.log1p(gained[1] / total)
    gained[1] = 0.0
    y, Y, Yu = engine.outputs(x, u, row)
    Ym, w = np.zeros((len(y), len(spread))), engine.holding(row)
    engine.functions.outputs_signature(x, u, w, engine.p, engine.g, Ym)
    by_all = np.hstack([Y, np.zeros((len(y), 1)), Ym])
    variance = np.einsum("oi,ij,oj->o", by_all, P, by_all) + Yu**2 @ engine.timeline.variance
    rows.x[o], rows.P[o], rows.total[o] = x, now.P, total
    rows.outputs[o] = np.column_stack([y, variance])
    rows.energy[o, :3] = now.E[0], P[n, n], now.E[1]
    rows.energy[o, 3:] = now.sE
    rows.gained[o] = gained[0]


@checked
def filterpy_of(
    vehicle: Vehicle | str | Path, signals: Signals | Logs | None = None, *, consider: bool = True
) -> OnlineFilter:
    """A vehicle's model in ``filterpy.kalman.ExtendedKalmanFilter``.

    With ``signals`` of one drive, its ``timeline`` has their events, and ``take(k)`` filters one
    after the other: the same as a replay, without ``consider`` as one that takes the parameters
    for certain.  Without signals it stands at rest with every input at its default or 0, for
    ``predict`` and ``correct`` with values of one's own; all mapped signals drive its equations.
    """
    vehicle = load_vehicle(vehicle)
    signals = None if signals is None else as_signals(signals, vehicle)
    names = set(vehicle.signals) if signals is None else set(signals.available)
    compiled = compile_model(vehicle, vehicle.machine.equations(names))
    late = delays(vehicle)
    if signals is None:
        line = _without_events(DriveSetup(vehicle, compiled.model, 1.0, late))
    else:
        line = build(evenly_late(signals, vehicle), vehicle, compiled.model, 10.0, late)
    return OnlineFilter(compiled, fresh(vehicle, compiled, line), line, consider=consider)


def _without_events(setup: DriveSetup) -> Timeline:
    """Regimes and the inputs' noise, and a moment with every input at its default."""
    inputs = setup.model.inputs
    signals = setup.vehicle.signals
    mapped = [None if item.exact else signals.get(item.name) for item in inputs]
    one = np.zeros(1, np.int64)
    W, Q, longest = setup.tables
    return Timeline(
        t=np.zeros(1),
        sensor=np.full(1, -1, np.int8),
        z=np.zeros(1),
        R=np.zeros(1),
        u=np.array([[item.default or 0.0 for item in inputs]]),
        row=one,
        W=W,
        Q=Q,
        longest=longest,
        mode=np.zeros(1, np.uint8),
        emit=one - 1,
        grid=np.zeros(0, bool),
        noise=np.array(
            [white_density(m.noise, m.noise_ar, m.period or 0.0) if m else 0.0 for m in mapped]
        ),
        variance=np.array([m.noise**2 if m else 0.0 for m in mapped]),
        warnings=(),
    )
