"""One event timeline of a drive: every sensor sample at its own time, inputs between theirs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clutchest.errors import ClutchestError
from clutchest.estimate.modes import Mode, Thresholds, classify
from clutchest.models.model import Model
from clutchest.signals import Floats, Signal, Signals
from clutchest.vehicle import Vehicle

FAST = 0.02  # s, longest step while the surfaces slide
SLOW = 0.5  # s, longest step while nothing but heat flows
SLOPE_WINDOW = 0.1  # s, over which the slope of the engine speed is fitted
DENSE = 0.02  # s, spacing of the outputs that engagements are measured on


@dataclass(frozen=True, slots=True)
class Timeline:
    """Events k = 0…K−1 in order of time, as the kernel takes them.

    ``t`` s; ``sensor`` index or −1; ``z`` its reading, ``R`` its variance; ``u`` (K, nu) inputs;
    ``row`` the regime of the interval that ends at k, row of the tables ``W`` (flags), ``Q``
    (process noise, variance per s) and ``longest`` (s); ``mode`` by :class:`Mode`; ``emit``
    output row or −1; ``grid`` True where an output row belongs to the regular grid.
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
    """Variance per s of every state, shape (n,), by vehicle file or model."""
    densities = []
    for state in model.states:
        setting = vehicle.estimation.get(state.name)
        role = setting.role if setting else state.role
        density = setting.process_noise if setting else state.process_noise
        if parked:
            density = state.parked_noise
        densities.append(0.0 if role != "adaptive" else density**2)
    return np.array(densities)


def white_density(signal: Signal, noise: float, ar: float) -> float:
    """Noise variance per s of a sampled input that is integrated over: σ² Ts (1 + ρ)/(1 − ρ)."""
    period = float(np.median(np.diff(signal.time))) if len(signal) > 1 else 0.0
    return noise**2 * period * (1 + ar) / (1 - ar)


def slope(signal: Signal, noise: float) -> tuple[Signal, float]:
    """Slope of a signal by straight lines through ``SLOPE_WINDOW`` s, and its standard deviation.

    Outside the reach of a full window the nearest full one stands.
    """
    time, value = signal.time, signal.value
    period = float(np.median(np.diff(time))) if len(time) > 1 else 1.0
    count = int(np.clip(round(SLOPE_WINDOW / max(period, 1e-6)) | 1, 3, 101))
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


def _usable(signals: Signals, vehicle: Vehicle, name: str, delays: Mapping[str, float]) -> Signal:
    """The valid samples of a signal, each at the time at which it was true."""
    signal = signals[name].only_valid()
    mapped = vehicle.signals.get(name)
    late = (mapped.delay if mapped else 0.0) + delays.get(name, 0.0)
    if not late:
        return signal
    return Signal(signal.name, signal.unit, signal.time - late, signal.value, signal.why)


def _blind(time: Floats, signal: Signal, gap: float) -> NDArray[np.bool_]:
    """Where the nearest samples on both sides lie further apart than ``gap`` s."""
    after = np.searchsorted(signal.time, time)
    before = np.clip(after - 1, 0, len(signal) - 1)
    after = np.clip(after, 0, len(signal) - 1)
    hole = signal.time[after] - signal.time[before] > gap
    outside = (time < signal.time[0] - gap) | (time > signal.time[-1] + gap)
    return hole | outside


def build(
    signals: Signals, vehicle: Vehicle, model: Model, rate: float, delays: Mapping[str, float]
) -> Timeline:
    """The timeline of one drive, with outputs at ``rate`` Hz.

    ``delays`` s by signal come on top of the vehicle file's.  Raises ClutchestError when a signal
    that the model cannot do without has no valid sample.
    """
    thresholds = Thresholds.of(vehicle.modes)
    missing = [i.name for i in model.inputs if i.default is None and i.name not in signals
               and i.name != "engine_acceleration"]  # fmt: skip
    if "engine_speed" not in signals:
        missing.append("engine_speed")
    present = {name: _usable(signals, vehicle, name, delays) for name in signals}
    missing += [name for name, signal in present.items() if not len(signal)
                and name in {i.name for i in model.inputs if i.default is None} | {"engine_speed"}]  # fmt: skip
    if missing:
        raise ClutchestError(
            f"no valid sample of {', '.join(sorted(set(missing)))}: the {vehicle.name} vehicle's "
            f"model needs {', '.join(i.name for i in model.inputs if i.default is None)}"
        )
    present = {name: signal for name, signal in present.items() if len(signal)}
    speed = present["engine_speed"]
    sigma = {name: mapped.noise for name, mapped in vehicle.signals.items()}
    colour = {name: mapped.noise_ar for name, mapped in vehicle.signals.items()}
    present["engine_acceleration"], sigma["engine_acceleration"] = slope(
        speed, sigma.get("engine_speed", 0.0)
    )

    end = max(signals.end, speed.time[-1])
    first = max(0.0, min(s.time[0] for s in present.values()))
    grid = np.arange(np.ceil(first * rate) / rate, end + 1e-9, 1.0 / rate)
    fast = [i.name for i in model.inputs if i.name in present and i.gap <= thresholds.gap]
    stamps = np.unique(np.concatenate([speed.time, grid, *(present[n].time for n in fast)]))
    stamps = stamps[(stamps >= first) & (stamps <= end)]

    def at(name: str, times: Floats) -> Floats:
        return np.interp(times, present[name].time, present[name].value)

    # regimes at every stamp
    slip = None
    if "input_shaft_speed" in present:
        slip = at("engine_speed", stamps) - at("input_shaft_speed", stamps)
    nominal = {key: value.value for key, value in vehicle.parameters.items()}
    position = None
    if "slave_position" in present:
        position = at("slave_position", stamps) - nominal["position_origin"]
    motor = at("motor_position", stamps) if "motor_position" in present else None
    blind = np.zeros(len(stamps), bool)
    for name in fast:
        blind |= _blind(stamps, present[name], thresholds.gap)
    regimes = classify(
        stamps, slip, position, motor, blind, nominal.get("kiss_point", 0.0), thresholds
    )

    # events: sensor samples, kinks of the inputs while they matter, outputs
    keep = (regimes.sliding | np.isin(stamps, grid)) & ~np.isin(stamps, speed.time)
    times, index = [stamps[keep]], [np.full(int(keep.sum()), -1, np.int8)]
    values, variances = [np.zeros(int(keep.sum()))], [np.zeros(int(keep.sum()))]
    readings = {"engine_speed": speed}
    if "slave_position" in present:
        readings["zero_position"] = present["slave_position"]
        sigma["zero_position"], colour["zero_position"] = (
            sigma.get("slave_position", 0.0), colour.get("slave_position", 0.0))  # fmt: skip
    for i, sensor in enumerate(model.sensors):
        if sensor.name not in readings:
            continue
        signal = readings[sensor.name]
        if sensor.name == "zero_position":
            rows = np.clip(np.searchsorted(stamps, signal.time), 0, len(stamps) - 1)
            home = (regimes.mode[rows] == Mode.retracted) & (signal.time <= stamps[-1])
            signal = Signal(signal.name, signal.unit, signal.time[home], signal.value[home],
                            signal.why[home])  # fmt: skip
        ar = colour.get(sensor.name, 0.0)
        times.append(signal.time)
        index.append(np.full(len(signal), i, np.int8))
        values.append(signal.value)
        # coloured noise tells less per sample than white noise of the same size
        variances.append(np.full(len(signal), sigma[sensor.name] ** 2 * (1 + ar) / (1 - ar)))
    t, sensor_of = np.concatenate(times), np.concatenate(index)
    order = np.lexsort((sensor_of, t))
    t, sensor_of = t[order], sensor_of[order]
    z, R = np.concatenate(values)[order], np.concatenate(variances)[order]
    inside = (t >= first) & (t <= end)
    t, sensor_of, z, R = t[inside], sensor_of[inside], z[inside], R[inside]

    of = np.clip(np.searchsorted(stamps, t), 0, len(stamps) - 1)
    # an interval has the regime that holds at both its ends
    sliding, engaged = regimes.sliding[of], regimes.engaged[of]
    free = regimes.free_running[of].copy()
    free[1:] &= regimes.free_running[of[:-1]]
    row = free * 4 + sliding * 2 + engaged
    flags = np.array([[r >> 2 & 1, r >> 1 & 1, r & 1] for r in range(8)], float)
    Q = np.tile(process_noise(vehicle, model), (8, 1))
    for name, (flag, walk) in model.renewed.items():
        Q[flags[:, model.regime.index(flag)] == 0, model.state(name)] = walk**2
    longest = np.where(flags[:, 1] > 0, FAST, SLOW)

    u = np.empty((len(t), len(model.inputs)))
    noise, variance = np.zeros(len(model.inputs)), np.zeros(len(model.inputs))
    for j, item in enumerate(model.inputs):
        if item.name not in present:
            u[:, j] = item.default
            continue
        u[:, j] = at(item.name, t)
        variance[j] = sigma.get(item.name, 0.0) ** 2
        if item.name != "engine_acceleration":  # a slope's noise cancels when it is summed up
            noise[j] = white_density(
                present[item.name], sigma.get(item.name, 0.0), colour.get(item.name, 0.0)
            )

    # outputs: the grid, and densely wherever the surfaces slide
    last = np.append(np.diff(t) > 0, True)  # after the last event of a time stamp
    on_grid = last & np.isin(t, grid)
    dense = np.zeros(len(t), bool)
    ticks = np.floor(t / DENSE)
    dense[1:] = sliding[1:] & (np.diff(ticks) > 0)
    dense[1:] |= np.diff(sliding.astype(np.int8)) != 0
    emitted = on_grid | (dense & last)
    emit = np.where(emitted, np.cumsum(emitted) - 1, -1)

    warnings = []
    for name in fast:
        holes = np.diff(present[name].time)
        if np.any(holes > thresholds.gap):
            warnings.append(
                f"{name}: {int(np.sum(holes > thresholds.gap))} gap(s), the longest "
                f"{holes.max():.1f} s; heat of a slip in a gap is not seen"
            )
    return Timeline(t, sensor_of, z, R, u, row, flags, Q, longest, regimes.mode[of],
                    emit, on_grid[emitted], noise, variance, tuple(warnings))  # fmt: skip
