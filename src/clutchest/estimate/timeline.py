"""One event timeline of a drive: every sensor sample at its own time, inputs between theirs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from clutchest.estimate.drive_setup import DriveSetup, usable, warnings_of
from clutchest.estimate.sample_timing import SampleTiming
from clutchest.estimate.samples import (
    SensorReadings,
    blind,
    places,
    readings_of,
    slope,
    white_density,
)
from clutchest.models.model import Model
from clutchest.models.regimes import FREE, Observed, Regimes
from clutchest.models.thresholds import Thresholds
from clutchest.native import compiled
from clutchest.signals import LOST, Floats, Signal, Signals
from clutchest.vehicle import Vehicle

DENSE = 0.02  # s, spacing of the outputs that engagements are measured on


@dataclass(frozen=True, slots=True)
class Timeline:
    """Events k = 0…K−1 in order of time, as the kernel takes them.

    ``t`` s; ``sensor`` index or −1; ``z`` its reading, ``R`` its variance; ``u`` (K, nu) inputs;
    ``row`` the regime of the interval that ends at k, row of the tables ``W`` (flags), ``Q``
    (process noise, variance per s and per J) and ``longest`` (s); ``mode`` its place among the
    machine's modes; ``emit`` output row or −1; ``grid`` True where an output row belongs to the
    regular grid.  ``noise`` (nu) density and ``variance`` (nu) of the inputs' own noise.
    """

    t: Floats
    sensor: NDArray[np.int8]
    z: Floats
    R: Floats
    u: Floats
    row: NDArray[np.int64]
    W: Floats
    Q: Floats
    longest: Floats
    mode: NDArray[np.uint8]
    emit: NDArray[np.int64]
    grid: NDArray[np.bool_]
    noise: Floats
    variance: Floats
    warnings: tuple[str, ...]

    def first(self, count: int) -> Timeline:
        """The first so many of its events."""
        names = ("t", "sensor", "z", "R", "u", "row", "mode", "emit")
        return replace(self, **{name: getattr(self, name)[:count] for name in names})


def build(
    signals: Signals, vehicle: Vehicle, model: Model, rate: float, delays: Mapping[str, float]
) -> Timeline:
    """The timeline of one drive, with outputs at ``rate`` Hz.

    ``delays`` s by signal come on top of the vehicle file's.  Raises ClutchestError when a signal
    that the model cannot do without has no valid sample.
    """
    setup = DriveSetup(vehicle, model, rate, delays)
    present, timings = usable(signals, setup)
    first = max(0.0, min(s.time[0] for s in present.values()))
    end = max(signals.end, present[model.anchor].time[-1])
    line = assemble(setup, present, timings, Interval(first, end)).line
    return replace(line, warnings=warnings_of(signals, setup))


@dataclass(frozen=True, slots=True)
class Interval:
    """From ``since`` to ``end``, s, of a drive.

    ``averaged``: sensor → time, s, up to which its readings are averaged already.
    """

    since: float
    end: float
    averaged: Mapping[int, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Assembled:
    """The timeline of an interval, every time ``stamps`` (n,) at which its regime was judged, and
    the averaged readings by sensor."""

    line: Timeline
    stamps: Floats
    averages: Mapping[int, SensorReadings]


@dataclass(frozen=True, slots=True)
class _Events:
    """Events in order of time, (K,) each; see :class:`Timeline`."""

    t: Floats
    sensor: NDArray[np.int8]
    z: Floats
    R: Floats


def assemble(
    setup: DriveSetup,
    present: Mapping[str, Signal],
    timings: Mapping[str, SampleTiming],
    interval: Interval,
) -> Assembled:
    """The timeline of an interval.

    ``present`` are the cleaned signals, with some samples before and after the interval where there
    are any, ``timings`` their periods.
    """
    model, signals = setup.model, dict(present)
    slope_noises = {}
    for name, source in model.slopes.items():
        signals[name], slope_noises[name] = slope(
            present[source],
            setup.noise(source),
            timing=timings[source],
            gap=setup.thresholds.gap,
        )
    fast = [name for name in setup.fast(signals) if name in signals]
    grid = _grid(setup.rate, interval)
    anchor = signals[model.anchor].time
    stamps = _united([anchor, grid, *(signals[name].time for name in fast)])
    stamps = stamps[(stamps >= interval.since) & (stamps <= interval.end)]
    regime = regimes(stamps, signals, setup.vehicle, fast)
    # kinks of the inputs while they matter, and the times of outputs
    bare = stamps[(regime.sliding | _among(stamps, grid)) & ~_among(stamps, anchor)]
    readings = _readings(setup, signals, timings, interval, stamps, regime)
    events = _in_order(readings, bare, interval)

    of = np.minimum(places(stamps, events.t), len(stamps) - 1)
    flags = _over_intervals(regime.flags(model.regime), of, model.regime)
    table, process, longest = setup.tables
    place = 2 ** np.arange(len(model.regime))[::-1]
    u, noise, variance = _inputs(events.t, setup, signals, timings, slope_noises)
    for name, source in model.slopes.items():  # no slope where no sample supports one
        u[blind(events.t, present[source], LOST), model.input(name)] = 0.0
    emit, on_grid = _outputs(events.t, regime.sliding[of], grid)
    line = Timeline(
        t=events.t,
        sensor=events.sensor,
        z=events.z,
        R=events.R,
        u=u,
        row=flags @ place,
        W=table,
        Q=process,
        longest=longest,
        mode=regime.mode[of],
        emit=emit,
        grid=on_grid,
        noise=noise,
        variance=variance,
        warnings=(),
    )
    repeated = {i for i, sensor in enumerate(model.sensors) if sensor.repeats}
    return Assembled(line, stamps, {i: each for i, each in readings.items() if i in repeated})


def _grid(rate: float, interval: Interval) -> Floats:
    """Times of outputs, multiples of 1/``rate``; the end of an interval that holds none."""
    first, last = np.ceil(interval.since * rate), np.floor((interval.end + 1e-9) * rate)
    grid = np.arange(first, last + 1) / rate
    return grid if len(grid) else np.array([interval.end])


def _united(times: Sequence[Floats]) -> Floats:
    """All ``times``, ascending and each once.  What is in order within each of them is merged, a
    tenth of the time of a sort."""
    every = np.concatenate(times)
    every.sort(kind="stable")
    return every[np.diff(every, prepend=-np.inf) > 0.0]


def _readings(
    setup: DriveSetup,
    signals: Mapping[str, Signal],
    timings: Mapping[str, SampleTiming],
    interval: Interval,
    stamps: Floats,
    regime: Regimes,
) -> dict[int, SensorReadings]:
    """The readings of each sensor that has a signal, in the mode in which it is read."""
    readings = {}
    for i, sensor in enumerate(setup.model.sensors):
        name = sensor.column or sensor.name
        if name not in signals:
            continue
        signal = signals[name]
        if sensor.mode:
            signal = _where(signal, stamps, regime.mode == setup.modes.index(sensor.mode))
        if i in interval.averaged:
            signal = _after(signal, interval.averaged[i])
        readings[i] = readings_of(
            signal, setup.noise(name), setup.noise_ar(name), sensor.repeats, timings[name]
        )
    return readings


def _in_order(readings: Mapping[int, SensorReadings], bare: Floats, interval: Interval) -> _Events:
    """The ``readings`` by sensor, and the ``bare`` times without one, inside the interval."""
    nothing = np.zeros(len(bare))
    t = np.concatenate([bare, *(r.time for r in readings.values())])
    sensor = np.concatenate(
        [
            np.full(len(bare), -1, np.int8),
            *(np.full(len(r.time), i, np.int8) for i, r in readings.items()),
        ]
    )
    z = np.concatenate([nothing, *(r.value for r in readings.values())])
    R = np.concatenate([nothing, *(r.variance for r in readings.values())])
    order = np.lexsort((sensor, t))
    order = order[(t[order] >= interval.since) & (t[order] <= interval.end)]
    return _Events(t[order], sensor[order], z[order], R[order])


def regimes(
    stamps: Floats, present: Mapping[str, Signal], vehicle: Vehicle, fast: Sequence[str] = ()
) -> Regimes:
    """Which equations hold at every stamp, by signals that are ``present``; ``fast`` ones must not
    be missing for long."""
    thresholds = Thresholds.of(vehicle.modes)

    def at(name: str) -> Floats | None:
        if name not in present:
            return None
        return present[name].at(stamps)

    missing, lost = np.zeros((2, len(stamps)), bool)
    for name in fast:
        missing |= blind(stamps, present[name], thresholds.gap)
        lost |= blind(stamps, present[name], LOST)
    parameters = {key: value.value for key, value in vehicle.parameters.items()}
    observed = Observed(stamps, at, missing, lost, parameters, thresholds)
    return vehicle.machine.regimes.judge(observed)


def _where(signal: Signal, stamps: Floats, flag: NDArray[np.bool_]) -> Signal:
    """The samples of ``signal`` that fall on stamps with the flag."""
    rows = np.minimum(places(stamps, signal.time), len(stamps) - 1)
    keep = flag[rows] & (signal.time <= stamps[-1])
    return signal.take(keep)


def _after(signal: Signal, time: float) -> Signal:
    """The samples after ``time`` s."""
    keep = signal.time > time
    return signal.take(keep)


def _inputs(
    t: Floats,
    setup: DriveSetup,
    present: Mapping[str, Signal],
    timings: Mapping[str, SampleTiming],
    noises: Mapping[str, float],
) -> tuple[Floats, Floats, Floats]:
    """Inputs (K, nu) between their own stamps, with noise density and variance (nu).

    ``noises`` are those of the slopes.  An input that may be missing for long changes slowly and
    holds its last value, so that a live estimate need not wait for the next one.
    """
    model = setup.model
    fast = setup.fast(present)
    u = np.empty((len(t), len(model.inputs)))
    noise, variance = np.zeros(len(model.inputs)), np.zeros(len(model.inputs))
    for j, item in enumerate(model.inputs):
        if item.name not in present:
            u[:, j] = item.default
            continue
        signal, sigma = present[item.name], noises.get(item.name, setup.noise(item.name))
        u[:, j] = signal.at(t, LOST if item.name in fast else 0.0)
        if item.exact:
            continue
        variance[j] = sigma**2
        if item.name not in model.slopes:  # a slope's noise cancels when it is summed up
            period = timings[item.name].period
            noise[j] = white_density(sigma, setup.noise_ar(item.name), period)
    return u, noise, variance


def _among(values: Floats, some: Floats) -> NDArray[np.bool_]:
    """Which of the ascending ``values`` (n), each there once, are among ``some``, ascending."""
    place, among = places(values, some), np.zeros(len(values), bool)
    inside = place < len(values)
    place, some = place[inside], some[inside]
    among[place[values[place] == some]] = True
    return among


def _over_intervals(
    acting: NDArray[np.bool_], of: NDArray[np.intp], regime: Sequence[str]
) -> NDArray[np.int64]:
    """Flags (K, w) of the interval that ends at each event: an interval runs free if both its ends
    do, the rest is as at its end."""
    flags = acting[of]
    if FREE in regime:
        flags[1:, regime.index(FREE)] &= acting[of[:-1], regime.index(FREE)]
    return flags.astype(np.int64)


def _outputs(
    t: Floats, sliding: NDArray[np.bool_], grid: Floats
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Output row of every event (−1: none), on the grid and densely wherever the surfaces slide,
    and of every row whether it is on the grid."""
    emit, on_grid = _emitted(t, sliding, grid)
    return emit, on_grid[emit >= 0]


@compiled
def _emitted(t, sliding, grid):  # type: ignore[no-untyped-def]
    emit, on_grid = np.full(len(t), -1, np.int64), np.zeros(len(t), np.bool_)
    rows = place = 0
    for k in range(len(t)):
        if k + 1 < len(t) and t[k + 1] <= t[k]:
            continue  # after the last event of a time stamp
        while place < len(grid) - 1 and grid[place] < t[k]:
            place += 1
        on_grid[k] = grid[place] == t[k]
        dense = k > 0 and (
            sliding[k] != sliding[k - 1]
            or (sliding[k] and np.floor(t[k] / DENSE) > np.floor(t[k - 1] / DENSE))
        )
        if on_grid[k] or dense:
            emit[k] = rows
            rows += 1
    return emit, on_grid
