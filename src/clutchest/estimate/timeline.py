"""One event timeline of a drive: every sensor sample at its own time, inputs between theirs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from clutchest.estimate.drive_setup import DriveSetup, usable, warnings_of
from clutchest.estimate.sample_timing import SampleTiming
from clutchest.estimate.samples import Told, blind, slope, told, white_density
from clutchest.models.model import Model
from clutchest.models.regimes import FREE, Observed, Regimes
from clutchest.models.thresholds import Thresholds
from clutchest.signals import LOST, Floats, Signal, Signals
from clutchest.vehicle import Vehicle

DENSE = 0.02  # s, spacing of the outputs that engagements are measured on


@dataclass(frozen=True, slots=True)
class Timeline:
    """Events k = 0…K−1 in order of time, as the kernel takes them.

    ``t`` s; ``sensor`` index or −1; ``z`` its reading, ``R`` its variance; ``u`` (K, nu) inputs;
    ``row`` the regime of the interval that ends at k, row of the tables ``W`` (flags), ``Q``
    (process noise, variance per s and per J) and ``longest`` (s); ``mode`` its place among the
    machine's modes;
    ``emit`` output row or −1; ``grid`` True where an output row belongs to the regular grid.
    ``noise`` (nu) density and ``variance`` (nu) of the inputs' own noise.
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


def build(
    signals: Signals, vehicle: Vehicle, model: Model, rate: float, delays: Mapping[str, float]
) -> Timeline:
    """The timeline of one drive, with outputs at ``rate`` Hz.

    ``delays`` s by signal come on top of the vehicle file's.  Raises ClutchestError when a signal
    that the model cannot do without has no valid sample.
    """
    setting = DriveSetup(vehicle, model, rate, delays)
    present, timings = usable(signals, setting)
    first = max(0.0, min(s.time[0] for s in present.values()))
    end = max(signals.end, present[model.anchor].time[-1])
    line = assemble(setting, present, timings, Stretch(first, end)).line
    return replace(line, warnings=warnings_of(signals, setting))


@dataclass(frozen=True, slots=True)
class Stretch:
    """From ``since`` to ``end``, s, of a drive.

    ``averaged`` says of a sensor up to when its readings have been averaged already.
    """

    since: float
    end: float
    averaged: Mapping[int, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Assembled:
    """A stretch's timeline, every time ``stamps`` (n,) at which its regime was judged, and by
    sensor what averaging it told."""

    line: Timeline
    stamps: Floats
    averages: Mapping[int, Told]


def assemble(
    setting: DriveSetup,
    present: Mapping[str, Signal],
    timings: Mapping[str, SampleTiming],
    stretch: Stretch,
) -> Assembled:
    """The timeline of a stretch.

    ``present`` are the cleaned signals with some samples before the stretch and behind it, as far
    as there are any, ``habits`` their habits.
    """
    model, rate, thresholds = setting.model, setting.rate, setting.thresholds
    present, since, end = dict(present), stretch.since, stretch.end
    anchor = present[model.anchor]
    noises = {}
    for name, source in model.slopes.items():
        present[name], noises[name] = slope(
            present[source], setting.noise(source), timing=timings[source], gap=thresholds.gap
        )
    fast = [name for name in setting.fast(present) if name in present]

    # every time at which something is measured, or wanted
    grid = np.arange(np.ceil(since * rate), np.floor((end + 1e-9) * rate) + 1) / rate
    if not len(grid):  # a log that ends before the first row of the grid still has an end
        grid = np.array([end])
    stamps = np.unique(np.concatenate([anchor.time, grid, *(present[n].time for n in fast)]))
    stamps = stamps[(stamps >= since) & (stamps <= end)]
    regime = regimes(stamps, present, setting.vehicle, fast)
    acting = regime.flags(model.regime)

    # events: sensor samples, kinks of the inputs while they matter, outputs
    bare = stamps[(regime.sliding | _among(stamps, grid)) & ~_among(stamps, anchor.time)]
    times, sensors = [bare], [np.full(len(bare), -1, np.int8)]
    values, variances = [np.zeros(len(bare))], [np.zeros(len(bare))]
    averages = {}
    for i, sensor in enumerate(model.sensors):
        name = sensor.column or sensor.name
        if name not in present:
            continue
        reading = present[name]
        if sensor.mode:
            reading = _where(reading, stamps, regime.mode == setting.modes.index(sensor.mode))
        if i in stretch.averaged:
            reading = _after(reading, stretch.averaged[i])
        found = told(
            reading, setting.noise(name), setting.noise_ar(name), sensor.repeats, timings[name]
        )
        if sensor.repeats:
            averages[i] = found
        times.append(found.time)
        sensors.append(np.full(len(found.time), i, np.int8))
        values.append(found.value)
        variances.append(found.variance)
    t, sensor_of = np.concatenate(times), np.concatenate(sensors)
    order = np.lexsort((sensor_of, t))
    order = order[(t[order] >= since) & (t[order] <= end)]
    t, sensor_of = t[order], sensor_of[order]

    of = np.clip(np.searchsorted(stamps, t), 0, len(stamps) - 1)
    sliding, flags = regime.sliding[of], _over_intervals(acting, of, model.regime)
    table, process, longest = setting.tables
    place = 2 ** np.arange(len(model.regime))[::-1]
    u, noise, variance = _inputs(t, setting, present, timings, noises)
    for name, source in model.slopes.items():  # a slope that no sample bears out is none
        u[blind(t, present[source], LOST), model.input(name)] = 0.0
    emit, on_grid = _outputs(t, sliding, grid)
    line = Timeline(
        t=t,
        sensor=sensor_of,
        z=np.concatenate(values)[order],
        R=np.concatenate(variances)[order],
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
    return Assembled(line, stamps, averages)


def regimes(
    stamps: Floats, present: Mapping[str, Signal], vehicle: Vehicle, fast: Sequence[str] = ()
) -> Regimes:
    """Which equations hold at every stamp, by signals that are ``present``.

    In a gap of a ``fast`` one nothing is taken for sure.
    """
    thresholds = Thresholds.of(vehicle.modes)

    def at(name: str) -> Floats | None:
        if name not in present:
            return None
        return present[name].at(stamps)

    unseen, lost = np.zeros((2, len(stamps)), bool)
    for name in fast:
        unseen |= blind(stamps, present[name], thresholds.gap)
        lost |= blind(stamps, present[name], LOST)
    parameters = {key: value.value for key, value in vehicle.parameters.items()}
    observed = Observed(stamps, at, unseen, lost, parameters, thresholds)
    return vehicle.machine.regimes.judge(observed)


def _where(signal: Signal, stamps: Floats, flag: NDArray[np.bool_]) -> Signal:
    """The samples of ``signal`` that fall on stamps with the flag."""
    rows = np.clip(np.searchsorted(stamps, signal.time), 0, len(stamps) - 1)
    keep = flag[rows] & (signal.time <= stamps[-1])
    return signal.take(keep)


def _after(signal: Signal, time: float) -> Signal:
    """The samples behind ``time`` s."""
    keep = signal.time > time
    return signal.take(keep)


def _inputs(
    t: Floats,
    setting: DriveSetup,
    present: Mapping[str, Signal],
    timings: Mapping[str, SampleTiming],
    noises: Mapping[str, float],
) -> tuple[Floats, Floats, Floats]:
    """Inputs (K, nu) between their own stamps, with noise density and variance (nu).

    ``noises`` are those of the slopes.  What may be missing for long changes slowly and holds its
    last value, so that nobody waits for the next one.
    """
    model = setting.model
    fast = setting.fast(present)
    u = np.empty((len(t), len(model.inputs)))
    noise, variance = np.zeros(len(model.inputs)), np.zeros(len(model.inputs))
    for j, item in enumerate(model.inputs):
        if item.name not in present:
            u[:, j] = item.default
            continue
        signal, sigma = present[item.name], noises.get(item.name, setting.noise(item.name))
        u[:, j] = signal.at(t, LOST if item.name in fast else 0.0)
        variance[j] = sigma**2
        if item.name not in model.slopes:  # a slope's noise cancels when it is summed up
            period = timings[item.name].period
            noise[j] = white_density(sigma, setting.noise_ar(item.name), period)
    return u, noise, variance


def _among(values: Floats, some: Floats) -> NDArray[np.bool_]:
    """Which of ``values`` (n) are among the ascending ``some``, at least one."""
    place = np.minimum(np.searchsorted(some, values), len(some) - 1)
    return np.asarray(some[place] == values)


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


@njit(cache=True)
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
