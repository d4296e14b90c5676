"""Drives from a machine's own equations, where it has no generator: truth and model are the same.

What such a drive cannot show is an error of the equations themselves, unless it is put in as an
effect.  It is integrated by Runge–Kutta's rule of fourth order (the process noise by Euler's and
Maruyama's), ten steps to the longest one that the filter may take.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import ceil

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from clutchest.casadi_later import one_at_a_time
from clutchest.errors import ClutchestError, nearest
from clutchest.generator.mismatch import Mismatch
from clutchest.generator.request import DriveRequest
from clutchest.generator.sampling import Sampled, sample
from clutchest.generator.surroundings import stream
from clutchest.models.effects import Effect, Lateness
from clutchest.models.model import Expressions, Model
from clutchest.models.regimes import Observed
from clutchest.models.thresholds import Thresholds
from clutchest.signals import Floats, Truth
from clutchest.vehicle import Vehicle
from clutchest.vehicle.state_uncertainty import prior_std, process_noise

DURATION = 120.0  # s, unless another one is asked for
GRID = 1e-3  # s between moments that are kept
FINER = 10  # steps to the longest one of the filter
TOGETHER = 1000  # steps in one call
TRUTH_EVERY = 10  # moments of the grid to one row of the truth's table

Effects = Mapping[str, Mapping[str, float]]


@dataclass(frozen=True)
class _Numbers:
    """Equations with numbers: parameters ``p``, numbers ``g`` of the effects, flags ``w`` that are
    all on."""

    model: Model
    e: Expressions
    p: Floats
    g: Floats
    w: Floats


def generate(vehicle: Vehicle, request: DriveRequest) -> Sampled:
    """A drive of a vehicle whose machine declares excitations; a drive of ``DURATION`` s unless the
    request states another.

    Raises ClutchestError for what is unknown, for disturbances that only a generator of its own
    makes, for inputs that the excitation does not give, and where the states do not stay finite.
    """
    request.from_the_start()
    unmade = request.outsider or request.deviations or request.mismatch != Mismatch()
    if any(request.disturbances.sizes().values()) or unmade:
        raise ClutchestError(
            f"disturbances: not without a generator, which '{vehicle.machine.name}' does not have"
        )
    duration = DURATION if request.duration is None else request.duration
    if not 0.0 < duration < np.inf:
        raise ClutchestError(f"duration {duration:g} s: expected more than 0 s")
    present = _present(vehicle, request.effects)
    model = vehicle.machine.equations(vehicle.signals).with_effects(tuple(present))
    drawn = _drawn(vehicle, model, request)
    e = model.expressions()
    numbers = _Numbers(
        model,
        e,
        np.array([drawn[parameter.key] for parameter in model.parameters]),
        np.array([present[effect][key] for effect, key in model.numbers]),
        np.concatenate([np.ones(len(model.regime)), np.zeros(len(model.doubted))]),
    )
    time = np.arange(ceil(duration / GRID) + 1, dtype=np.float64) * GRID
    u = _inputs(vehicle, model, request, time, drawn)
    x = _integrated(vehicle, numbers, request, time, u, drawn)
    readings = _along(numbers, e.readings, x, u)
    quantities = _quantities(model, time, u, readings)
    for channel in request.channels:
        if channel.name not in quantities:
            raise ClutchestError(
                f"simulate: '{channel.name}' is neither an input nor a sensor of "
                f"'{vehicle.machine.name}'" + nearest(channel.name, quantities)
            )
    late = _late(present, quantities)
    return Sampled(
        sample(request.channels, late, request.seed, duration, request.outliers),
        _truth(vehicle, numbers, time, x, u, quantities),
        drawn,
        request.seed,
        request.scenario,
    )


def _present(vehicle: Vehicle, effects: Effects) -> dict[Effect, dict[str, float]]:
    """Effect → all its numbers, of those that are asked for."""
    known = dict(vehicle.library)
    present = {}
    for name, values in effects.items():
        if name not in known:
            raise ClutchestError(f"unknown effect '{name}'" + nearest(name, known))
        keys = {number.key: number for number in known[name].parameters}
        for key in values:
            if key not in keys:
                raise ClutchestError(f"effect '{name}' has no '{key}'" + nearest(key, keys))
        absent = {key: n.default if n.shape else 0.0 for key, n in keys.items()}
        present[known[name]] = {**absent, **values}
    return present


def _drawn(vehicle: Vehicle, model: Model, request: DriveRequest) -> dict[str, float]:
    """Parameters by key: normal, within their bounds.  What is a state's prior varies with it."""
    seed = request.seed if request.truck_seed is None else request.truck_seed
    rng, drawn = stream(seed, "parameters"), {}
    fixed = {state.prior for state in model.states}
    for parameter in model.parameters:
        stated = vehicle.parameters[parameter.key]
        off = stated.spread * rng.standard_normal()
        value = stated.value + (0.0 if request.nominal or parameter.key in fixed else off)
        drawn[parameter.key] = float(np.clip(value, parameter.lower, parameter.upper))
    return drawn


def _inputs(
    vehicle: Vehicle, model: Model, request: DriveRequest, time: Floats, drawn: Mapping[str, float]
) -> Floats:
    """The inputs (k, nu) at every time, as the excitation gives them."""
    machine = vehicle.machine
    excitation = machine.excitations.get(request.scenario)
    if excitation is None:
        raise ClutchestError(
            f"unknown scenario '{request.scenario}'"
            + nearest(request.scenario, machine.excitations)
        )
    where = f"machine '{machine.name}': excitation '{request.scenario}'"
    try:
        given = dict(excitation(stream(request.seed, "excitation"), time, drawn))
        values = {name: np.asarray(value, float) for name, value in given.items()}
    except Exception as error:  # a user's function may raise anything
        words = " ".join(str(error).split())
        raise ClutchestError(f"{where}: {type(error).__name__}: {words}") from error
    names = [item.name for item in model.inputs]
    for name, value in values.items():
        if name not in names:
            raise ClutchestError(f"{where} gives '{name}', no input" + nearest(name, names))
        if value.shape not in ((), time.shape):
            raise ClutchestError(
                f"{where} gives '{name}' as an array of {value.shape}, expected one number, or one "
                f"at each of the {len(time)} times"
            )
        if not np.isfinite(value).all():
            raise ClutchestError(f"{where}: '{name}' is no number at every time")
    columns = []
    for item in model.inputs:
        source = model.slopes.get(item.name)
        if item.name in values:
            columns.append(np.broadcast_to(values[item.name], time.shape))
        elif source in values:
            columns.append(np.gradient(np.broadcast_to(values[source], time.shape), time))
        elif item.default is None and source is None:
            raise ClutchestError(f"{where} gives no '{item.name}', which the equations need")
        else:
            columns.append(np.full(len(time), item.default or 0.0))
    return np.stack(columns, axis=1)


def _start(
    vehicle: Vehicle,
    numbers: _Numbers,
    request: DriveRequest,
    u0: Floats,
    drawn: Mapping[str, float],
) -> Floats:
    """The state (n) in which the drive begins, a draw from where the filter takes it to be."""
    model = numbers.model
    rest = vehicle.machine.at_rest(drawn, {i.name: u0[j] for j, i in enumerate(model.inputs)})
    x = np.array([rest.get(state.name, 0.0) for state in model.states], float)
    rng = stream(request.seed, "start")
    for i, (state, std) in enumerate(zip(model.states, prior_std(vehicle, model), strict=True)):
        off = 0.0 if request.nominal else std * rng.standard_normal()
        x[i] = x[i] * np.exp(off / x[i]) if state.factor and x[i] > 0.0 else x[i] + off
    e = numbers.e
    first = ca.Function("first", [e.x, e.p, e.g], [e.initial])
    return np.array(first(x, numbers.p, numbers.g)).ravel()


def _integrated(
    vehicle: Vehicle,
    numbers: _Numbers,
    request: DriveRequest,
    time: Floats,
    u: Floats,
    drawn: Mapping[str, float],
) -> Floats:
    """The states (k, n) at every time."""
    model = numbers.model
    between = ceil(GRID * FINER / min(model.longest))
    steps = _steps(vehicle, numbers, GRID / between)
    fine = np.arange((len(time) - 1) * between + 1) * (GRID / between)
    rng = stream(request.seed, "process")
    x = np.empty((len(time), len(model.states)))
    x[0] = now = _start(vehicle, numbers, request, u[0], drawn)
    for begin in range(0, len(fine) - 1, TOGETHER * between):
        moments = np.minimum(np.arange(begin, begin + TOGETHER * between + 1), len(fine) - 1)
        along = np.stack([np.interp(fine[moments], time, column) for column in u.T])
        kicks = rng.standard_normal((len(model.states), len(moments) - 1))
        after = np.array(steps(now, along[:, :-1], along[:, 1:], kicks)).T[between - 1 :: between]
        first = begin // between + 1
        x[first : first + TOGETHER] = after[: len(time) - first]
        now = after[-1]
        if not np.isfinite(now).all():
            state = model.states[int(np.argmin(np.isfinite(now)))]
            raise ClutchestError(
                f"simulate: {state.name} of '{model.name}' does not stay finite, after "
                f"{time[first]:.0f} s; are the steps (Model.longest) short enough?"
            )
    return x


@one_at_a_time
def _steps(vehicle: Vehicle, numbers: _Numbers, dt: float) -> ca.Function:
    """From a state, inputs at both ends of ``TOGETHER`` times as many steps of ``dt`` s as the grid
    has, and normal random numbers, to the states after each."""
    e, model = numbers.e, numbers.model
    with_numbers = ca.substitute(
        [e.rate, e.mapped, model.power(e)],
        [e.w, e.p, e.g],
        [ca.DM(numbers.w), ca.DM(numbers.p), ca.DM(numbers.g)],
    )
    rate, mapped, power = with_numbers
    f = ca.Function("f", [e.x, e.u], [rate])
    jump = ca.Function("jump", [e.x, e.u0, e.u], [mapped])
    heat = ca.Function("heat", [e.x, e.u], [power])
    x, random = ca.SX.sym("x", len(model.states)), ca.SX.sym("random", len(model.states))
    ua, ub = ca.SX.sym("ua", len(model.inputs)), ca.SX.sym("ub", len(model.inputs))
    middle = (ua + ub) / 2
    k1 = f(x, ua)
    k2 = f(x + dt / 2 * k1, middle)
    k3 = f(x + dt / 2 * k2, middle)
    k4 = f(x + dt * k3, ub)
    per_second, per_joule = np.split(process_noise(vehicle, model), 2)
    variance = dt * (ca.DM(per_second) + ca.DM(per_joule) * ca.fabs(heat(x, ua)))
    after = x + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4) + ca.sqrt(variance) * random
    step = ca.Function("step", [x, ua, ub, random], [jump(after, ua, ub)])
    return step.mapaccum("steps", TOGETHER * round(GRID / dt))


def _along(numbers: _Numbers, wanted: ca.SX, x: Floats, u: Floats) -> Floats:
    w = np.broadcast_to(numbers.w, (len(x), len(numbers.w)))
    return numbers.e.along(wanted, x, u, w, numbers.p, numbers.g)


def _quantities(
    model: Model, time: Floats, u: Floats, readings: Floats
) -> dict[str, Callable[[Floats], Floats]]:
    """Canonical signal → its value as a function of time."""

    def between(values: Floats) -> Callable[[Floats], Floats]:
        return lambda t: np.interp(t, time, values)

    sensed = {s.column or s.name: between(readings[i]) for i, s in enumerate(model.sensors)}
    return {**sensed, **{item.name: between(u[:, j]) for j, item in enumerate(model.inputs)}}


def _late(
    present: Mapping[Effect, Mapping[str, float]],
    quantities: Mapping[str, Callable[[Floats], Floats]],
) -> dict[str, Callable[[Floats], Floats]]:
    """The quantities as late as effects make them."""

    def delayed(
        of: Callable[[Floats], Floats], by: Callable[[Floats], Floats]
    ) -> Callable[[Floats], Floats]:
        return lambda t: of(np.maximum(t - by(t), 0.0))

    late = dict(quantities)
    for effect, numbers in present.items():
        for signal, key in effect.delays.items():
            variation = effect.lateness.get(signal)
            size = numbers[key]

            def by(t: Floats, size: float = size, variation: Lateness | None = variation) -> Floats:
                if variation is None:
                    return np.full(len(t), size)
                covariate = quantities.get(variation.covariate, lambda t: t)
                return np.asarray(size * np.interp(covariate(t), variation.at, variation.seconds))

            late[signal] = delayed(late[signal], by)
    return late


def _truth(
    vehicle: Vehicle,
    numbers: _Numbers,
    time: Floats,
    x: Floats,
    u: Floats,
    quantities: Mapping[str, Callable[[Floats], Floats]],
) -> Truth:
    machine, model = vehicle.machine, numbers.model
    rows = slice(None, None, TRUTH_EVERY)
    time, x, u = time[rows], x[rows], u[rows]
    columns: dict[str, NDArray] = {state.name: x[:, i] for i, state in enumerate(model.states)}
    if machine.output:
        made = getattr(numbers.e.quantities, machine.output)
        columns["clutch_torque"] = _along(numbers, made, x, u)[0]
    never = np.zeros(len(time), bool)
    observed = Observed(
        time,
        lambda name: quantities[name](time) if name in quantities else None,
        never,
        never,
        {parameter.key: numbers.p[i] for i, parameter in enumerate(model.parameters)},
        Thresholds.of(vehicle.modes),
    )
    rules = machine.regimes
    columns["mode"] = np.array(rules.modes)[rules.judge(observed).mode]
    return Truth(time, columns)
