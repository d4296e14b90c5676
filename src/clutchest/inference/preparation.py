"""What is computed once about a drive before it is linearised: see :class:`PreparedDrive`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from clutchest.estimate.delay_equalisation import evenly_late
from clutchest.estimate.initial_state import fresh, nominal
from clutchest.estimate.samples import slope, slope_count
from clutchest.estimate.timeline import Timeline, build
from clutchest.estimate.whole_log import Compiled, delays
from clutchest.inference.decimation import decimated
from clutchest.inference.denoising import adaptive_mean, deadband, deadband_of_mean, mean_of_slow
from clutchest.inference.input_bends import bends, driving
from clutchest.inference.input_interpolation import InterpolatedInput, seldom, spacing
from clutchest.inference.input_noise_covariance import input_noise_directions
from clutchest.inference.linearisation import Derivatives, filtered
from clutchest.inference.noise_at_rest import without_noise
from clutchest.inference.operating_point import ModelNumbers, OperatingPoint
from clutchest.inference.prepared_drive import (
    DelayedSignal,
    FrozenGains,
    PreparedDrive,
    PreparedInputs,
    Readings,
    TrackedStates,
    UnaveragedReadings,
    constant,
)
from clutchest.models.effects.effect import TIME, Lateness
from clutchest.models.model import Model
from clutchest.signals import Floats, Signal, Signals
from clutchest.vehicle import Vehicle

SLOPE = 0.6  # s, over which a signal that may be late is smoothed: noise that stays in a slope goes
# with what it did to a tracked state before, and passes for a delay where noise is slow
RATE_WINDOW = 0.2  # s, over which the slope of a tracked state is fitted
SETTLING = 0.15  # s; a tracked state's first innovations have another autocorrelation than later
IMPLIED = 30.0  # of an input's noise, that it may lie from its reading
LEAST = 0.01  # standard deviations per unit; readings that respond less to every θ are left out


def prepared(
    signals: Signals, vehicle: Vehicle, compiled: Compiled, units: Floats
) -> PreparedDrive:
    """One drive, its inputs without their noise; what this does to the readings is not known yet.
    ``units`` (m) of the compiled model's thetas."""
    drive = _with_any_readings(signals, vehicle, compiled)
    by = Derivatives.of(drive, len(units))
    response, gains = filtered(drive, at_file(drive), drive.at_nominal, np.arange(len(units)), by)
    drive = replace(drive, gains=gains, at_nominal=response.implied)
    return replace(drive, readings=_readings(drive, by.table, units, signals, vehicle))


def prepared_like(drive: PreparedDrive, signals: Signals, vehicle: Vehicle) -> PreparedDrive:
    """The ``signals`` of the same drive once more, with all their readings: those that respond to
    nothing too."""
    other = _with_any_readings(signals, vehicle, drive.compiled)
    return replace(other, nominal=drive.nominal)


def _with_any_readings(signals: Signals, vehicle: Vehicle, compiled: Compiled) -> PreparedDrive:
    """One drive whose gains, and which of its events count as readings, is not known yet."""
    model, signals = compiled.model, evenly_late(signals, vehicle)
    which = np.array([state.name in model.followed for state in model.states])
    whole = _timeline(signals, vehicle, model, which)
    line = decimated(whole, model)
    start = fresh(vehicle, compiled, whole)
    start.P[~which] = 0.0
    start.P[:, ~which] = 0.0
    tracked = _tracked(model, line, whole, which)
    inputs = _inputs(signals, vehicle, model, line, whole, tracked.act)
    off = np.column_stack([each.off(line.t, inputs.spacing) for each in inputs.interpolated])
    first = nominal(compiled, whole)
    return PreparedDrive(
        compiled,
        without_noise(replace(line, u=line.u - off), inputs, compiled, first),
        _unaveraged(whole, model),
        first,
        start,
        _delayed(signals, compiled, line.t),
        model.expressions().plays,
        inputs,
        tracked,
        FrozenGains(np.zeros_like(tracked.rate), np.ones(len(line.t))),
        Readings.of(
            line, np.arange(len(line.t)), np.ones(len(line.t)), np.zeros(len(line.t), np.int64)
        ),
        OperatingPoint(np.zeros((len(line.t), len(model.states))), inputs.smooth, {}),
        constant(len(line.t)),
    )


def with_gains_at(drive: PreparedDrive, numbers: ModelNumbers) -> PreparedDrive:
    """The drive with the gains that the filter has at these numbers of the equations; with those
    that it has where the filter runs away there, so that they are of no use.  What noise of its
    inputs does to the readings stays as it was."""
    none = np.zeros(0, np.int64)
    response, gains = filtered(drive, numbers, drive.at_nominal, none, Derivatives.of(drive, 0))
    if not np.all(gains.variance > 0.0):
        return drive
    readings, std = drive.readings, np.sqrt(gains.variance)[drive.readings.event]
    scatter = readings.input_noise * (readings.std / std)[:, None]
    readings = replace(readings, std=std, input_noise=scatter)
    return replace(drive, gains=gains, readings=readings, at_nominal=response.implied)


def with_input_noise_at(
    drive: PreparedDrive, numbers: ModelNumbers, vehicle: Vehicle
) -> PreparedDrive:
    """The drive with what noise of its inputs does to the readings at these numbers."""
    directions = input_noise_directions(drive, numbers, vehicle)
    return replace(drive, readings=replace(drive.readings, input_noise=directions))


def at_file(drive: PreparedDrive) -> ModelNumbers:
    """The numbers of the vehicle file."""
    return ModelNumbers(drive.compiled.p, drive.compiled.g, drive.nominal, {})


def _timeline(
    signals: Signals, vehicle: Vehicle, model: Model, tracked: NDArray[np.bool_]
) -> Timeline:
    """Every event of the drive; only ``tracked`` states (n) have process noise."""
    line = build(signals, vehicle, model, 1.0, delays(vehicle))
    R = line.R.copy()
    for i, sensor in enumerate(model.sensors):
        if sensor.name in model.followed:  # a fast filter: what is left is whitened afterwards
            R[line.sensor == i] = vehicle.signals[sensor.column or sensor.name].noise ** 2
    return replace(line, Q=np.where(np.tile(tracked, 2), line.Q, 0.0), R=R)


def _unaveraged(whole: Timeline, model: Model) -> dict[int, UnaveragedReadings]:
    """The readings that decimation averages, by index of their sensor."""
    averaged = [i for i, sensor in enumerate(model.sensors) if sensor.mode]
    rows = {i: whole.sensor == i for i in averaged}
    return {
        i: UnaveragedReadings(whole.t[of], whole.z[of], np.sqrt(whole.R[of]))
        for i, of in rows.items()
    }


def _tracked(
    model: Model, line: Timeline, whole: Timeline, which: NDArray[np.bool_]
) -> TrackedStates:
    """Measured rates of the tracked states at every event of ``line``, and their values without the
    noise of their readings, all of which are on the ``whole`` one; none of what exact inputs
    drive."""
    act = np.full(len(line.t), bool(model.tracked) or not model.regime)
    for flag, _ in model.renewed.values():
        act |= line.W[line.row, model.regime.index(flag)] > 0
    rate = np.full((len(line.t), which.sum()), np.nan)  # where the filter puts it, unless renewed
    value = rate.copy()
    edges = line.t[1:][np.diff(act) != 0]
    for j, i in enumerate(np.flatnonzero(which)):
        if model.states[i].name not in model.renewed or _exactly_driven(i, model):
            continue
        read = whole.sensor == model.sensor(model.states[i].name)
        t, z = whole.t[read], whole.z[read]
        # no line is drawn across the place where another equation takes over
        pieces = np.split(np.arange(len(t)), np.searchsorted(t, edges))
        pieces = [k for k in pieces if len(k)]
        rates = [slope(Signal.of("", "", t[k], z[k]), 0.0, RATE_WINDOW)[0].value for k in pieces]
        values = [deadband(t[k], z[k], np.ones(len(k), bool)) for k in pieces]
        rate[:, j] = np.interp(line.t, t, np.concatenate(rates))
        value[:, j] = np.interp(line.t, t, np.concatenate(values))
    return TrackedStates(which, act, rate, value, _corrected(model, line, which), model.settling)


def _exactly_driven(state: np.intp, model: Model) -> bool:
    """Whether every input that moves a state is exact.  No measured rate tells then where in its
    noise an input lies: what the state is off its course is an error of the equations, and where
    inputs explain it, derivatives are not those of the innovations."""
    e = model.expressions()
    own = [model.inputs[j] for j in driving(model, e, e.rate[int(state)])]
    return bool(own) and all(item.exact for item in own)


def _corrected(model: Model, line: Timeline, which: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Whether a reading corrects each tracked state (K, c): none what an input settles at once,
    nor what sticks while it stands, which its noise would shake, and let creep."""
    corrected = np.ones((len(line.t), len(which)), bool)
    corrected[:, model.settling] = False
    for name, flag in model.uncorrected.items():
        corrected[:, model.state(name)] = line.W[line.row, model.regime.index(flag)] > 0.0
    return corrected[:, which]


def _inputs(
    signals: Signals,
    vehicle: Vehicle,
    model: Model,
    line: Timeline,
    whole: Timeline,
    act: NDArray[np.bool_],
) -> PreparedInputs:
    """Inputs interpolated, and those that may be late or move a step map without their noise.

    What drags something along moves far beyond its noise, and tells most of a delay as it sets off:
    its slope is not smoothed further.
    """
    slow = _slow(signals, model, whole)
    between = _interpolated(signals, vehicle, model, line, whole, slow)
    apart = spacing(line.t)
    mapped = [vehicle.signals.get(item.name) for item in model.inputs]
    noise = [
        0.0 if item.exact else s.noise if s else np.inf
        for item, s in zip(model.inputs, mapped, strict=True)
    ]
    ar = [s.noise_ar if s else 0.0 for s in mapped]
    late = {model.input(signal) for effect in model.effects for signal in effect.delays}
    dragging = model.expressions().dragging
    denoised, dragged, deadbands = {}, {}, {}
    for j in sorted(late.union(dragging)):
        time, value = between[j].time, between[j].value
        acts = np.interp(time, line.t, act) > 0.5
        if j not in dragging:
            # where a signal moves in short pulses, they are no more noise than its sensor has
            calm = deadband(time, value, acts, SLOPE, 2.0 * SLOPE, noise[j])
            denoised[j] = time, calm
            continue
        mean = adaptive_mean(time, value, noise[j], ar[j])
        denoised[j], dragged[j] = (time, value), (time, mean)
        deadbands[j] = time, deadband_of_mean(time, value, mean, acts, noise[j], ar[j])
    smooth = np.column_stack([each.at(line.t, apart) for each in between])
    limit = IMPLIED * np.array(noise)
    return PreparedInputs(between, apart, smooth, denoised, dragged, deadbands, limit, slow)


def _slow(signals: Signals, model: Model, whole: Timeline) -> NDArray[np.bool_]:
    """Inputs (nu) whose samples lie further apart than what the rate of a tracked state is measured
    over: no rate tells by how much their readings are off, one by one."""
    sensors = {sensor.name: i for i, sensor in enumerate(model.sensors)}
    reads = [whole.t[whole.sensor == sensors[name]] for name in model.followed if name in sensors]
    periods = [_period(t) for t in reads if len(t) > 1]
    window = max([RATE_WINDOW, *(slope_count(each, RATE_WINDOW) * each for each in periods)])
    names = [item.name for item in model.inputs]
    known = {name: signals[name].only_valid().time for name in names if name in signals}
    return np.array([_period(known[name]) > window if name in known else False for name in names])


def _period(t: Floats) -> float:
    """s from sample to sample; infinite where there is one at most."""
    return float(np.median(np.diff(t))) if len(t) > 1 else np.inf


def _interpolated(
    signals: Signals,
    vehicle: Vehicle,
    model: Model,
    line: Timeline,
    whole: Timeline,
    slow: NDArray[np.bool_],
) -> list[InterpolatedInput]:
    """Every input, with samples as close as the signal's, so that it can be shifted in time; of
    ``slow`` ones (nu) their mean, and of those that drive no tracked state and come too seldom to
    be smoothed otherwise: of an oil temperature at 10 Hz that does not move, noise would pass for a
    change that shows how friction goes with it.  Of what drives a tracked state, samples count, not
    integrals."""
    inputs, e = [], model.expressions()
    tracked = [model.state(name) for name in model.tracked]
    followed = driving(model, e, e.rate[tracked])
    for j, item in enumerate(model.inputs):
        between = InterpolatedInput.straight(line.t, line.u[:, j])
        if item.name in signals and line.noise[j] and len(signals[item.name].time) > 4:
            own, mapped = signals[item.name].time, vehicle.signals[item.name]
            read = np.interp(own, whole.t, whole.u[:, j])
            between = InterpolatedInput.of(own, read, mapped.noise)
            if j in followed:
                between = InterpolatedInput.at_samples(own, read, mapped.noise, mapped.noise_ar)
            if slow[j] or (j not in followed and seldom(own)):
                mean = mean_of_slow(own, read, mapped.noise, mapped.noise_ar)
                between = InterpolatedInput.straight(own, mean)
        inputs.append(between)
    return inputs


def _readings(
    drive: PreparedDrive,
    derivatives: Floats,
    units: Floats,
    signals: Signals,
    vehicle: Vehicle,
) -> Readings:
    """Those that respond to any θ, by the ``derivatives`` (K, m) at the file's numbers."""
    line, model = drive.line, drive.compiled.model
    with np.errstate(invalid="ignore"):  # far from the data the filter runs away
        std = np.sqrt(drive.gains.variance)
    responds = np.zeros(len(std), bool)
    for derivative, unit in zip(derivatives.T, units, strict=True):
        responds |= np.abs(derivative) * unit > LEAST * std
    # near lock-up a tracked state shows the clutch's shudder, not any θ
    reads = np.array([sensor.name for sensor in model.sensors])
    # where states are tracked throughout, everything rests on them
    tracks = np.isin(reads, list(model.followed)) | bool(model.tracked)
    settled = drive.tracked.act & (_since_acting(drive) > SETTLING)
    bent, out = bends(drive, signals, vehicle)
    settled &= ~out
    counts = (line.sensor >= 0) & (settled | ~tracks[line.sensor])
    events = np.flatnonzero(counts & responds)
    order = np.argsort(line.sensor[events], kind="stable")
    return Readings.of(line, events[order], std, bent)


def _since_acting(drive: PreparedDrive) -> Floats:
    """For how long the tracked states' equations have acted, s, at every event."""
    t, begins = drive.line.t, np.diff(drive.tracked.act.astype(int), prepend=0) == 1
    return t - np.maximum.accumulate(np.where(begins, t, t[0]))


def _delayed(signals: Signals, compiled: Compiled, t: Floats) -> list[DelayedSignal]:
    """What effects delay at events at ``t`` (K)."""
    numbers = [(effect.name, key) for effect, key in compiled.model.numbers]
    delayed = []
    for effect in compiled.model.effects:
        for signal, key in effect.delays.items():
            varies, name = effect.lateness.get(signal), (effect.name, key)
            size, reach = (_late_by(varies, signals, t), varies.reach) if varies else (1.0, 1.0)
            place = numbers.index(name), compiled.thetas.index(name)
            delayed.append(DelayedSignal(signal, *place, size, reach))
    return delayed


def _late_by(varies: Lateness, signals: Signals, t: Floats) -> Floats:
    """A delay at events at ``t`` (K), s; the most where nothing is known of what it goes with."""
    if varies.covariate == TIME:
        return np.interp(t, varies.at, varies.seconds)
    if varies.covariate not in signals.available:
        return np.full(len(t), varies.most)
    known = signals[varies.covariate].only_valid()
    late = np.interp(known.at(t), varies.at, varies.seconds)
    return np.where(t < known.time[0], varies.most, late)
