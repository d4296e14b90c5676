"""One event timeline of a drive: every sensor sample at its own time, inputs between theirs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from clutchest.errors import ClutchestError
from clutchest.estimate.modes import FREE, SLIDING, Mode, Regimes, Thresholds, classify
from clutchest.estimate.spikes import without_spikes
from clutchest.models.model import Model
from clutchest.signals import Floats, Signal, Signals
from clutchest.vehicle import Vehicle

COARSEST = 0.5  # s between samples of the model's anchor; a slip lasts little longer
LOST = 10.0  # s; through a longer hole in a signal no straight line is drawn
SLOPE_WINDOW = 0.1  # s, over which the slope of the engine speed is fitted
DENSE = 0.02  # s, spacing of the outputs that engagements are measured on


@dataclass(frozen=True, slots=True)
class Timeline:
    """Events k = 0…K−1 in order of time, as the kernel takes them.

    ``t`` s; ``sensor`` index or −1; ``z`` its reading, ``R`` its variance; ``u`` (K, nu) inputs;
    ``row`` the regime of the interval that ends at k, row of the tables ``W`` (flags), ``Q``
    (process noise, variance per s and per J) and ``longest`` (s); ``mode`` by :class:`Mode`;
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


def process_noise(vehicle: Vehicle, model: Model, parked: bool = False) -> Floats:
    """Variance per s, then per J of slip energy, of every state, shape (2n,), by vehicle file or
    model."""
    per_second, per_joule = [], []
    for state in model.states:
        setting = vehicle.estimation.get(state.name, state)  # the model's own unless the file's
        adaptive = setting.role == "adaptive"
        density = state.parked_noise if parked else setting.process_noise
        per_second.append(density**2 if adaptive else 0.0)
        per_joule.append(state.slip_noise**2 if adaptive else 0.0)
    return np.array(per_second + per_joule)


def white_density(signal: Signal, noise: float, ar: float) -> float:
    """Noise variance per s of a sampled input that is integrated over: σ² Ts (1 + ρ)/(1 − ρ)."""
    period = float(np.median(np.diff(signal.time))) if len(signal) > 1 else 0.0
    return noise**2 * period * (1 + ar) / (1 - ar)


def slope(signal: Signal, noise: float, window: float = SLOPE_WINDOW) -> tuple[Signal, float]:
    """Slope of a signal by straight lines through ``window`` s, and its standard deviation.

    Outside the reach of a full window the nearest full one stands.
    """
    time, value = signal.time, signal.value
    period = float(np.median(np.diff(time))) if len(time) > 1 else 1.0
    count = int(np.clip(round(window / max(period, 1e-6)) | 1, 3, 101))
    if len(time) < count:
        return Signal.of("slope", "", time, np.zeros(len(time))), 0.0
    t = np.lib.stride_tricks.sliding_window_view(time, count)
    y = np.lib.stride_tricks.sliding_window_view(value, count)
    centred = t - t.mean(axis=1, keepdims=True)
    moment = np.maximum((centred**2).sum(axis=1), 1e-12)
    slopes = (centred * y).sum(axis=1) / moment
    half = count // 2
    padded = np.pad(slopes, half, mode="edge")
    return Signal.of("slope", "", time, padded), float(noise / np.sqrt(np.median(moment)))


def build(
    signals: Signals, vehicle: Vehicle, model: Model, rate: float, delays: Mapping[str, float]
) -> Timeline:
    """The timeline of one drive, with outputs at ``rate`` Hz.

    ``delays`` s by signal come on top of the vehicle file's.  Raises ClutchestError when a signal
    that the model cannot do without has no valid sample.
    """
    thresholds = Thresholds.of(vehicle.modes)
    present, spikes = _usable(signals, vehicle, model, delays)
    noise_of = {name: mapped.noise for name, mapped in vehicle.signals.items()}
    colour_of = {name: mapped.noise_ar for name, mapped in vehicle.signals.items()}
    anchor = present[model.anchor]
    for name, of in model.slopes.items():
        present[name], noise_of[name] = slope(present[of], noise_of[of])
    fast = [i.name for i in model.inputs if i.name in present and i.gap <= thresholds.gap]

    # every time at which something is measured, or wanted
    first = max(0.0, min(s.time[0] for s in present.values()))
    end = max(signals.end, anchor.time[-1])
    grid = np.arange(np.ceil(first * rate) / rate, end + 1e-9, 1.0 / rate)
    if not len(grid):  # a log that ends before the first row of the grid still has an end
        grid = np.array([end])
    stamps = np.unique(np.concatenate([anchor.time, grid, *(present[n].time for n in fast)]))
    stamps = stamps[(stamps >= first) & (stamps <= end)]
    regime = regimes(stamps, present, vehicle, fast)
    acting = regime.flags(model.regime)

    # events: sensor samples, kinks of the inputs while they matter, outputs
    bare = stamps[(regime.sliding | np.isin(stamps, grid)) & ~np.isin(stamps, anchor.time)]
    times, sensors = [bare], [np.full(len(bare), -1, np.int8)]
    values, variances = [np.zeros(len(bare))], [np.zeros(len(bare))]
    for i, sensor in enumerate(model.sensors):
        name = sensor.column or sensor.name
        if name not in present:
            continue
        reading = present[name]
        if sensor.mode:
            reading = _where(reading, stamps, regime.mode == Mode[sensor.mode])
        time, value, variance = told(reading, noise_of[name], colour_of[name], sensor.repeats)
        times.append(time)
        sensors.append(np.full(len(time), i, np.int8))
        values.append(value)
        variances.append(variance)
    t, sensor_of = np.concatenate(times), np.concatenate(sensors)
    order = np.lexsort((sensor_of, t))
    order = order[(t[order] >= first) & (t[order] <= end)]
    t, sensor_of = t[order], sensor_of[order]

    of = np.clip(np.searchsorted(stamps, t), 0, len(stamps) - 1)
    sliding, flags = regime.sliding[of], _over_intervals(acting, of, model.regime)
    table = np.array(list(product((0.0, 1.0), repeat=len(model.regime))))
    place = 2 ** np.arange(len(model.regime))[::-1]
    u, noise, variance = _inputs(t, model, present, noise_of, colour_of)
    for name, source in model.slopes.items():  # a slope that no sample bears out is none
        u[_blind(t, present[source], LOST), model.input(name)] = 0.0
    emit, on_grid = _outputs(t, sliding, grid)
    return Timeline(
        t=t,
        sensor=sensor_of,
        z=np.concatenate(values)[order],
        R=np.concatenate(variances)[order],
        u=u,
        row=flags @ place,
        W=table,
        Q=_noise_table(vehicle, model, table),
        longest=_longest(model, table),
        mode=regime.mode[of],
        emit=emit,
        grid=on_grid,
        noise=noise,
        variance=variance,
        warnings=spikes + _gaps(present, fast, thresholds.gap),
    )


def _usable(
    signals: Signals, vehicle: Vehicle, model: Model, delays: Mapping[str, float]
) -> tuple[dict[str, Signal], tuple[str, ...]]:
    """The valid samples of every signal, each at the time at which it was true; and warnings."""
    needed = {i.name for i in model.inputs if i.default is None} - set(model.slopes)
    present, warnings = {}, []
    for name in signals:
        signal, mapped = signals[name].only_valid(), vehicle.signals.get(name)
        late = (mapped.delay if mapped else 0.0) + delays.get(name, 0.0)
        if len(signal):
            signal, spikes = without_spikes(signal, mapped.noise if mapped else 0.0)
            present[name] = replace(signal, time=signal.time - late) if late else signal
            if spikes:
                warnings.append(f"{name}: {spikes} single sample(s) far off both neighbours left "
                                f"out, {100 * spikes / (spikes + len(signal)):.2g} %")  # fmt: skip
    missing = sorted((needed | {model.anchor}) - set(present))
    if missing:
        hints = "".join(f"; {warning}" for warning in signals.warnings[:4])
        raise ClutchestError(
            f"no valid sample of {', '.join(missing)}: the model of '{vehicle.name}' needs it"
            + hints
        )
    anchor = present[model.anchor]
    if len(anchor) > 1 and (period := float(np.median(np.diff(anchor.time)))) > COARSEST:
        raise ClutchestError(
            f"{model.anchor} has a sample every {period:g} s, expected at least one every "
            f"{COARSEST:g} s; are the times in seconds?"
        )
    return present, tuple(warnings)


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
        return np.interp(stamps, present[name].time, present[name].value)

    blind, lost = np.zeros((2, len(stamps)), bool)
    for name in fast:
        blind |= _blind(stamps, present[name], thresholds.gap)
        lost |= _blind(stamps, present[name], LOST)
    nominal = {key: value.value for key, value in vehicle.parameters.items()}
    if "kiss_point" not in nominal:  # such a clutch's own state says what it does
        return Regimes.pressing(
            stamps, at("clutch_torque") if "clutch_torque" in present else at("shaft_torque"),
            lost, thresholds.guard,
        )  # fmt: skip
    speed, shaft, position = at("engine_speed"), at("input_shaft_speed"), at("slave_position")
    assert speed is not None
    return classify(
        stamps,
        None if shaft is None else speed - shaft,
        None if position is None else position - nominal["position_origin"],
        at("motor_position"),
        blind,
        nominal["kiss_point"],
        thresholds,
        lost,
    )


def _blind(time: Floats, signal: Signal, gap: float) -> NDArray[np.bool_]:
    """Where the nearest samples on both sides lie further apart than ``gap`` s; ``time`` sorted."""
    last = np.flatnonzero(np.diff(signal.time) > gap)  # samples before a hole
    holes = np.zeros(len(time) + 1, np.int64)
    np.add.at(holes, np.searchsorted(time, signal.time[last], "right"), 1)
    np.add.at(holes, np.searchsorted(time, signal.time[last + 1], "right"), -1)
    outside = (time < signal.time[0] - gap) | (time > signal.time[-1] + gap)
    return (np.cumsum(holes[:-1]) > 0) | outside


def _where(signal: Signal, stamps: Floats, flag: NDArray[np.bool_]) -> Signal:
    """The samples of ``signal`` that fall on stamps with the flag."""
    rows = np.clip(np.searchsorted(stamps, signal.time), 0, len(stamps) - 1)
    keep = flag[rows] & (signal.time <= stamps[-1])
    return replace(signal, time=signal.time[keep], value=signal.value[keep], why=signal.why[keep])


def told(signal: Signal, noise: float, ar: float, repeats: float) -> tuple[Floats, Floats, Floats]:
    """What the readings tell: times, values and variances of readings whose errors are white.

    Coloured noise repeats itself: its readings count for less.  Those that a sensor ``repeats``
    are averaged, and their average is no better than one of them.
    """
    if not len(signal):
        return signal.time, signal.value, signal.value
    steps = np.diff(signal.time)
    period = max(float(np.median(steps)) if len(steps) else 1.0, 1e-3)
    coloured = (1 + ar) / (1 - ar)
    most = round(2.0 * repeats / period) | 1  # odd: the middle one is where the average holds
    starts = np.flatnonzero(np.append(True, steps > 4.0 * period))
    place = np.arange(len(signal)) - np.repeat(starts, np.diff(np.append(starts, len(signal))))
    first = np.flatnonzero(place % most == 0)
    count = np.diff(np.append(first, len(signal)))
    value = np.add.reduceat(signal.value, first) / count
    variance = noise**2 * np.maximum(coloured, most) / count
    return signal.time[first + count // 2], value, variance


def _inputs(
    t: Floats,
    model: Model,
    present: Mapping[str, Signal],
    noise_of: Mapping[str, float],
    colour_of: Mapping[str, float],
) -> tuple[Floats, Floats, Floats]:
    """Inputs (K, nu) straight between their own stamps, with noise density and variance (nu)."""
    u = np.empty((len(t), len(model.inputs)))
    noise, variance = np.zeros(len(model.inputs)), np.zeros(len(model.inputs))
    for j, item in enumerate(model.inputs):
        if item.name not in present:
            u[:, j] = item.default
            continue
        signal, sigma = present[item.name], noise_of[item.name]
        u[:, j] = np.interp(t, signal.time, signal.value)
        variance[j] = sigma**2
        if item.name not in model.slopes:  # a slope's noise cancels when it is summed up
            noise[j] = white_density(signal, sigma, colour_of[item.name])
    return u, noise, variance


def _noise_table(vehicle: Vehicle, model: Model, flags: Floats) -> Floats:
    """Process noise, variance per s, of every state in every regime; shape (rows of flags, 2n)."""
    Q = np.tile(process_noise(vehicle, model), (len(flags), 1))
    for name, (flag, walk) in model.renewed.items():
        Q[flags[:, model.regime.index(flag)] == 0, model.state(name)] = walk**2
    return Q


def _over_intervals(acting: NDArray[np.bool_], of: NDArray[np.intp],
                    regime: Sequence[str]) -> NDArray[np.int64]:  # fmt: skip
    """Flags (K, w) of the interval that ends at each event: an interval runs free if both its ends
    do, the rest is as at its end."""
    flags = acting[of]
    if FREE in regime:
        flags[1:, regime.index(FREE)] &= acting[of[:-1], regime.index(FREE)]
    return flags.astype(np.int64)


def _longest(model: Model, table: Floats) -> Floats:
    """The longest step, s, under every row of flags."""
    slides = table[:, model.regime.index(SLIDING)] > 0 if SLIDING in model.regime else [True]
    return np.where(slides, *model.longest)


def _outputs(
    t: Floats, sliding: NDArray[np.bool_], grid: Floats
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Output row of every event (−1: none), on the grid and densely wherever the surfaces slide,
    and of every row whether it is on the grid."""
    last = np.append(np.diff(t) > 0, True)  # after the last event of a time stamp
    on_grid = last & np.isin(t, grid)
    dense = np.zeros(len(t), bool)
    dense[1:] = sliding[1:] & (np.diff(np.floor(t / DENSE)) > 0)
    dense[1:] |= np.diff(sliding.astype(np.int8)) != 0
    emitted = on_grid | (dense & last)
    return np.where(emitted, np.cumsum(emitted) - 1, -1), on_grid[emitted]


def _gaps(present: Mapping[str, Signal], fast: list[str], gap: float) -> tuple[str, ...]:
    warnings = []
    for name in fast:
        holes = np.diff(present[name].time)
        holes = holes[holes > gap]
        if len(holes):
            warnings.append(
                f"{name}: {len(holes)} gap(s), the longest {holes.max():.1f} s; "
                "heat of a slip in a gap is not seen"
            )
    return tuple(warnings)
