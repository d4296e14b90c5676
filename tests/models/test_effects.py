"""The battery that every effect of every model passes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from bench import BENCHES, Bench, machine
from clutchest.compute.step import heun
from clutchest.estimate import whole_log
from clutchest.estimate.timeline import Timeline
from clutchest.estimate.whole_log import FilterOptions
from clutchest.models import names
from clutchest.models.effects import Effect, Number
from clutchest.models.model import Model
from equations import argument_names, draw, vector

from .dimensions import UnitsError, balances, carried, dimensions_of, per_second

CASES = [(model, name) for model in BENCHES for name in machine(model).effects]
GAINS = [
    (model, name, number.key)
    for model, name in CASES
    for number in machine(model).effects[name].gains
]

BenchOf = Callable[[str], Bench]


def bounds(*owned: Effect) -> dict[str, tuple[float, float]]:
    return {f"{e.name}.{n.key}": (n.lower, n.upper) for e in owned for n in e.parameters}


def ranges_of(bench: Bench, model: Model) -> dict[str, tuple[float, float]]:
    """Everything the equations read, parameters aside."""
    return {
        **{s.name: bench.plausible.states[s.name] for s in model.states},
        **{i.name: bench.plausible.inputs[i.name] for i in model.inputs},
        **dict.fromkeys(model.regime, (0.0, 1.0)),
    }


def parameters(bench: Bench) -> dict[str, float]:
    return {key: value.value for key, value in bench.vehicle.parameters.items()}


# --- the registry ---


def test_the_registry_is_what_the_catalogue_says() -> None:
    """Every effect class there is stands in the battery and carries its public name."""
    assert set(BENCHES) >= set(names())
    for model, setup in BENCHES.items():
        effects, catalogue = machine(model).effects, setup.catalogue
        assert set(effects) == set(catalogue)
        for name, effect in effects.items():
            numbers = ", ".join(f"{n.key} {n.unit}" for n in effect.parameters)
            one_sided = all(n.one_sided for n in effect.gains)
            assert ("+ " if one_sided else "") + numbers == catalogue[name]
            if model in names():
                assert type(effect).__module__.endswith(f".{model}.effects.{name}")


@pytest.mark.parametrize(("model", "name"), CASES)
def test_an_effect_says_what_it_is(model: str, name: str, bench: BenchOf) -> None:
    effect = machine(model).effects[name]
    equation = type(effect).__doc__ or ""
    assert all(f"``{number.key}``" in equation for number in effect.parameters)
    columns = set(bench(model).plausible.inputs) | {s.name for s in bench(model).model.sensors}
    kind, _, column = effect.equation.partition(":")
    equations = {error_term.equation for error_term in machine(model).error_terms.values()}
    assert effect.equation in equations or (kind in ("sensor", "timing") and column in columns)
    assert effect.gains
    for number in effect.parameters:
        assert np.isfinite([number.lower, number.upper]).all()
        assert number.lower < number.upper
        assert dimensions_of(number.unit) is not None
        if number.shape:
            assert all(number.lower <= v <= number.upper for v in (number.default, *number.grid))
            assert number.grid
        else:
            assert number.lower <= 0.0 < number.upper
            assert number.default == 0.0


# --- a. gain 0 is as good as absent, to the last bit ---


def test_all_effects_at_gain_0_leave_the_filter_as_it_was(model: str, bench: BenchOf) -> None:
    """Over a drive that starts with a second in which no input moves."""
    b = bench(model)
    line = b.timeline(b.bare)
    line.u[line.t < 1.0] = line.u[0]
    without = whole_log.run(b.bare, line, b.belief(b.bare, line))
    present = whole_log.run(b.full, _with_brought(b, line), b.belief(b.full, line))
    n = len(b.model.states)
    assert np.array_equal(without.x, present.x[:, :n])
    assert np.array_equal(without.P, present.P[:, :n, :n])
    assert np.array_equal(without.innovation, present.innovation)
    assert np.array_equal(without.outputs, present.outputs)
    assert without.log_likelihood == present.log_likelihood


def _with_brought(b: Bench, line: Timeline) -> Timeline:
    """The same events, with process noise for the states that effects bring."""
    return replace(line, Q=b.timeline(b.full).Q)


@pytest.mark.parametrize(("model", "name"), CASES)
def test_gain_0_is_absent_in_every_step(model: str, name: str, bench: BenchOf) -> None:
    """State, transition, noise, readings and outputs of one step: the same bits."""
    b, effect = bench(model), machine(model).effects[name]
    rng = np.random.default_rng(1)
    functions = [_step(m) for m in (b.model, b.model.with_effects((effect,)))]
    n = len(b.model.states)
    shapes = [number.default for number in effect.parameters]
    for _ in range(100):
        x, u0, w, p, _ = _point(b, b.model, rng)
        u1 = vector(argument_names(b.model)[1], draw(rng, b.plausible.inputs))
        q, noise = rng.uniform(0, 1, (2, n)), rng.uniform(0, 1, len(u0))
        brought = np.zeros(len(effect.states))
        dt = b.model.longest[0]
        plain = functions[0](x, u0, u1, dt, w, p, [], q.ravel(), noise)
        filled = functions[1](
            np.append(x, brought),
            u0,
            u1,
            dt,
            w,
            p,
            shapes,
            np.hstack([q, [brought] * 2]).ravel(),
            noise,
        )
        for a, c in zip(plain, filled, strict=True):
            a, c = np.array(a), np.array(c)
            assert np.array_equal(a, c[: a.shape[0], : a.shape[1]])


def _step(model: Model) -> ca.Function:
    e = model.expressions()
    s = heun(model, e)
    made = [s.x, ca.jacobian(s.x, e.x), s.Q, s.energy, e.readings, e.outputs]
    return ca.Function("step", [e.x, e.u, s.u1, s.dt, e.w, e.p, e.g, s.q, s.noise], made)


def _point(b: Bench, model: Model, rng: np.random.Generator, corners: bool = False) -> list:
    """x, u, w, p, g drawn from where they are plausible; flags are 0 or 1."""
    values = draw(rng, {**ranges_of(b, model), **bounds(*model.effects)}, corners)
    values |= {flag: float(rng.integers(2)) for flag in model.regime}
    values |= parameters(b)
    return [vector(group, values) for group in argument_names(model)]


# --- b. the signature is the derivative of whole runs ---


@pytest.mark.parametrize(("model", "name", "key"), GAINS)
def test_the_signature_is_what_a_small_gain_does(
    model: str, name: str, key: str, bench: BenchOf
) -> None:
    """Innovations at gain ε, the filter's own gains frozen, against those at 0.

    ε is far above rounding, and so small that hardly a sample changes sides of a kink: the cap
    of the disc's expansion, an onset, the ends of the play.
    """
    b = bench(model)
    line, base = b.at_zero
    effect, k = machine(model).effects[name], b.full.thetas.index((name, key))
    largest = next(number.upper for number in effect.gains if number.key == key)
    size = 1e-6 * largest
    late = {signal: size for signal, number in effect.delays.items() if number == key}

    g = b.full.g.copy()
    g[[(e.name, number) for e, number in b.full.model.numbers].index((name, key))] = size
    moved = replace(b.full, g=g)
    shifted = _delayed(line, b.timeline(moved, late)) if late else line
    rows, other = np.flatnonzero(line.sensor >= 0), np.flatnonzero(shifted.sensor >= 0)
    frozen = np.zeros((len(shifted.t), base.gains.shape[1]))
    frozen[other] = base.gains[rows]
    small = whole_log.run(
        moved, shifted, b.belief(moved, shifted), FilterOptions(gains=frozen, signature=False)
    )

    std = np.sqrt(base.innovation[rows, 1])
    result = (small.innovation[other, 0] - base.innovation[rows, 0]) / size / std
    stated = base.signature[rows, k] / std
    assert np.linalg.norm(stated) * largest > 0.01, "the drive excites it"
    assert np.linalg.norm(result - stated) <= 0.02 * np.linalg.norm(stated)


def _delayed(line: Timeline, shifted: Timeline) -> Timeline:
    """``line`` with the inputs of ``shifted``: regimes and readings stay at their own times."""
    stamps = np.setdiff1d(shifted.t, line.t)  # where the delayed signal has its kinks now
    stamps = stamps[stamps > line.t[0]]
    t, none = np.concatenate([line.t, stamps]), np.zeros(len(stamps))
    sensor = np.concatenate([line.sensor, np.full(len(stamps), -1, np.int8)])
    order = np.lexsort((sensor, t))
    t, sensor = t[order], sensor[order]
    interval = np.minimum(np.searchsorted(line.t, t), len(line.t) - 1)
    return replace(
        line,
        t=t,
        sensor=sensor,
        z=np.append(line.z, none)[order],
        R=np.append(line.R, none)[order],
        row=line.row[interval],
        u=np.column_stack([np.interp(t, shifted.t, column) for column in shifted.u.T]),
        mode=line.mode[interval],
        emit=np.full(len(t), -1),
    )


# --- c. finite everywhere ---


@pytest.mark.parametrize("corners", [False, True])
def test_everything_is_finite_within_the_bounds(model: str, corners: bool, bench: BenchOf) -> None:
    """Steps, readings, outputs and their signatures, each effect at work and all at once."""
    b = bench(model)
    f, m, rng = b.full.functions, b.full.model, np.random.default_rng(2)
    n, nu, no, k = f.STATES, f.INPUTS, f.OUTPUTS, f.THETAS
    dt, resting, names_of = m.longest[0], b.plausible.resting, argument_names(m)
    largest = bounds(*m.effects)
    absent = dict(zip(argument_names(m)[4], b.full.g, strict=True))
    alone = [{**absent, **{key: largest[key] for key in bounds(e)}} for e in m.effects]
    for chosen in [*alone, *[largest] * 200]:
        drawn = {key: v if isinstance(v, tuple) else (v, v) for key, v in chosen.items()}
        x, u0, w, p, _ = _point(b, m, rng, corners)
        u1 = vector(argument_names(m)[1], draw(rng, b.plausible.inputs, corners))
        if rng.random() < 0.2:  # nothing slips or moves at all
            for names, values in ((names_of[0], x), (names_of[1], u0)):
                values[:] = vector(names, {**dict(zip(names, values, strict=True)), **resting})
            u1[:] = u0
        g = vector(argument_names(m)[4], draw(rng, drawn, corners))
        made = [
            np.zeros(s)
            for s in (n, (n, n), (n, n), n, (n, k), k, no, (no, n), (no, nu), (no, k), n, k)
        ]
        xn, F, Q, e, G, eG, y, Y, Yu, Ym, H, Hm = made
        f.step(x, u0, u1, dt, w, p, g, np.ones(2 * n), np.ones(nu), xn, F, Q, e)
        f.step_signature(x, u0, u1, dt, w, p, g, (u1 - u0) / dt, G, eG)
        f.outputs(x, u1, w, p, g, y, Y, Yu)
        f.outputs_signature(x, u1, w, p, g, Ym)
        for sensor in range(f.SENSORS):
            assert np.isfinite(f.reading(sensor, x, u1, w, p, g, H))
            f.reading_signature(sensor, x, u1, w, p, g, Hm)
            assert all(np.isfinite(array).all() for array in made), (chosen, x, u0, u1, w)


# --- d. friction opposes slip ---


@pytest.mark.parametrize(("model", "name"), CASES)
def test_torque_opposes_slip(model: str, name: str, bench: BenchOf) -> None:
    """Whatever the effect's size, a clutch brakes: torque on the engine has the sign of slip."""
    b = bench(model)
    m = b.model.with_effects((machine(model).effects[name],))
    e, rng = m.expressions(), np.random.default_rng(3)
    at = [e.x, e.u, e.w, e.p, e.g]
    settled = ca.Function("settled", at, [ca.substitute(e.mapped, e.u0, e.u)])
    brake = ca.Function("brake", at, [e.quantities.clutch_torque, e.quantities.slip_speed])
    after = brake(settled(*at), *at[1:])  # as every step leaves the state
    function = ca.Function("after", at, list(after))
    for corners in (False, True):
        drawn = [
            {
                **draw(rng, ranges_of(b, m)),
                **draw(rng, bounds(*m.effects), corners),
                **parameters(b),
            }
            for _ in range(300)
        ]
        for values in drawn:
            for spring, by in b.plausible.wound.items():
                values[spring] = abs(values[spring]) * np.sign(values[by])
        columns = [
            ca.DM(np.array([vector(group, values) for values in drawn]).T)
            for group in argument_names(m)
        ]
        torque, slip = (np.array(row).ravel() for row in function(*columns))
        assert np.all(torque * slip >= 0.0)
        assert np.sum(torque != 0.0) > 50, "the points hold a clutch that is pressed together"


# --- e. temperatures relax ---


@pytest.mark.parametrize(("model", "name"), CASES)
def test_temperatures_relax_to_their_surroundings(model: str, name: str, bench: BenchOf) -> None:
    """Without slip nothing grows, and everything settles between the hottest and the coldest."""
    from scipy.integrate import solve_ivp

    b, effect = bench(model), machine(model).effects[name]
    m, rng = b.model.with_effects((effect,)), np.random.default_rng(4)
    e = m.expressions()
    rate = ca.Function("rate", [e.x, e.u, e.w, e.p, e.g], [e.rate])
    heated = [m.state(temperature) for temperature in b.plausible.temperatures]
    for corners in (False, True, True):
        given = draw(rng, {**ranges_of(b, m), **bounds(effect)}, corners)
        given |= {**b.plausible.resting, **parameters(b), **dict.fromkeys(m.regime, 0.0)}
        x0, *rest = (vector(group, given) for group in argument_names(m))
        x, T = ca.SX(x0), ca.SX.sym("T", len(heated))
        x[heated] = T
        by_temperature = ca.Function("rates", [T], [rate(x, *rest)[heated]])

        def rates(_: float, T: np.ndarray, of: ca.Function = by_temperature) -> np.ndarray:
            return np.array(of(T)).ravel()

        around = [given[s] for s in b.plausible.surroundings]
        around += b.plausible.beyond.get(name, ())
        trajectory = solve_ivp(rates, (0.0, 3e5), x0[heated], method="LSODA", rtol=1e-8, atol=1e-8)
        every = [*around, *x0[heated]]
        assert trajectory.y.min() >= min(every) - 1e-5
        assert trajectory.y.max() <= max(every) + 1e-5
        assert np.all(trajectory.y[:, -1] >= min(around) - 1e-3)
        assert np.all(trajectory.y[:, -1] <= max(around) + 1e-3)
        assert np.abs(rates(0.0, trajectory.y[:, -1])).max() < 1e-6


# --- f. units balance ---


def check_units(model: Model) -> None:
    """Raises UnitsError unless rates, readings, outputs and maps have the units they should."""
    e = model.expressions()
    states = [dimensions_of(s.unit) for s in model.states]
    inputs = [dimensions_of(i.unit) for i in model.inputs]
    given = {
        0: states,
        1: inputs,
        2: inputs,
        3: [dimensions_of("1")] * len(model.regime)
        + [states[model.state(name)] for name in model.doubted],
        4: [dimensions_of(p.unit) for p in model.parameters],
        5: [dimensions_of(n.unit) for effect in model.effects for n in effect.parameters],
    }
    wanted = {
        "rate": [per_second(s) for s in states],
        "readings": [dimensions_of(s.unit) for s in model.sensors],
        "outputs": [dimensions_of({"power": "W"}.get(name, "Nm")) for name in model.outputs],
        "initial": states,
        "mapped": states,
    }
    made = [ca.densify(getattr(e, name)) for name in wanted]
    result = carried(ca.Function("units", [e.x, e.u, e.u0, e.w, e.p, e.g], made), given)
    for (name, units), row in zip(wanted.items(), result, strict=True):
        for i, (has, should) in enumerate(zip(row, units, strict=True)):
            if not balances(has, should):
                raise UnitsError(f"{name}[{i}] has {has}, should have {should}")


@pytest.mark.parametrize(("model", "name"), CASES)
def test_units_balance(model: str, name: str, bench: BenchOf) -> None:
    check_units(bench(model).model.with_effects((machine(model).effects[name],)))


WRONG = {
    "a temperature added to a torque": ("drag_torque", "1", lambda m, q, g: m + q.temp_disc),
    "a slope per kelvin on a square": (
        "sliding_torque",
        "1/(100 K)",
        lambda m, q, g: m * (1 + g * q.temp_disc**2),
    ),
    "a speed in an exponential": ("sliding_torque", "1", lambda m, q, g: m * ca.exp(q.slip_speed)),
    "a speed compared with a torque": (
        "sliding_torque",
        "1",
        lambda m, q, g: m * (q.slip_speed < m),
    ),
    "a gain in the wrong unit": ("zero_position_rate", "mm/s", lambda r, q, g: r - g * q.power),
    "a product for a quotient": ("temp_disc_rate", "1", lambda r, q, g: r * q.heat_capacity_disc),
    "branches of two kinds": (
        "drag_torque",
        "1",
        lambda m, q, g: ca.if_else(g > 0, q.sliding_torque, q.slip_speed),
    ),
}


@pytest.mark.parametrize("what", WRONG)
def test_a_wrong_equation_does_not_balance(what: str, bench: BenchOf) -> None:
    quantity, unit, term = WRONG[what]

    class Wrong(Effect):
        name, model, equation = "wrong", "dry_clutch", "torque"
        parameters = (Number("gain", unit, -1.0, 1.0),)

        def terms(self, g):
            return {quantity: lambda value, q: term(value, q, g.gain)}

    with pytest.raises(UnitsError):
        check_units(bench("dry_clutch").model.with_effects((Wrong(),)))
