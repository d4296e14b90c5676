"""The differential's effects: absent at 0, in units that balance, at work where they say."""

from __future__ import annotations

from functools import cache

import casadi as ca
import numpy as np
import pytest

from clutchest.compute.step import heun
from clutchest.generator.alsd import EFFECTS
from clutchest.models.alsd import ALSD
from clutchest.models.effects import Effect, library
from clutchest.models.model import Model
from clutchest.vehicle import load_vehicle

from .dimensions import balances, carried, dimensions_of, per_second

LIBRARY = library("alsd")
# What a slipping, warm clutch under load looks like, and how far values scatter around it.
LOADED = {
    "current": 8.0, "motor_speed": 40.0, "motor_angle": 22.0, "ball_ramp_bristle": 0.03,
    "pack_force": 2e4, "wind_up": 0.05, "free_play": 1.9e-4, "friction": 1.0, "temp_pack": 80.0,
    "temp_armature": 70.0, "armature_voltage": 6.0, "slip_speed": 2.6, "oil_temp": 90.0,
}  # fmt: skip


@cache
def rig() -> dict[str, float]:
    return {key: value.value for key, value in load_vehicle("alsd_rig").parameters.items()}


def point(model: Model, rng: np.random.Generator) -> list[np.ndarray]:
    """x, u, p around a loaded clutch."""
    near = {name: value * rng.uniform(0.8, 1.2) for name, value in LOADED.items()}
    groups = ([s.name for s in model.states], [i.name for i in model.inputs])
    return [np.array([near[name] for name in group]) for group in groups] + [
        np.array([rig()[p.key] for p in model.parameters])
    ]


def function(model: Model) -> ca.Function:
    """(x, u, p, g) → rates, readings, outputs, start and one step of 1 ms."""
    e = model.expressions()
    s = heun(model, e)
    x1 = ca.substitute(ca.substitute(s.x, s.dt, 1e-3), s.u1, e.u)
    return ca.Function("f", [e.x, e.u, e.p, e.g], [e.rate, e.readings, e.outputs, e.initial, x1])


@cache
def bare() -> ca.Function:
    return function(ALSD)


def numbers(effect: Effect, gain: float) -> list[float]:
    return [n.default if n.shape else gain * n.upper for n in effect.parameters]


@pytest.mark.parametrize("effect", LIBRARY.values(), ids=LIBRARY)
def test_absent_at_0_and_at_work_otherwise(effect: Effect) -> None:
    """The same bits at gain 0; at a tenth of the largest plausible size something changes."""
    made = function(ALSD.with_effects((effect,)))
    rng, worked = np.random.default_rng(5), False
    for _ in range(20):
        at = point(ALSD, rng)
        without = [np.array(part) for part in bare()(*at, [])]
        absent = [np.array(part) for part in made(*at, numbers(effect, 0.0))]
        for a, b in zip(without, absent, strict=True):
            assert np.array_equal(a, b)
        present = [np.array(part) for part in made(*at, numbers(effect, 0.1))]
        assert all(np.isfinite(part).all() for part in present)
        worked |= any(not np.array_equal(a, b) for a, b in zip(without, present, strict=True))
    assert worked


@pytest.mark.parametrize("effect", [None, *LIBRARY.values()], ids=["none", *LIBRARY])
def test_units_balance(effect: Effect | None) -> None:
    model = ALSD.with_effects((effect,) if effect else ())
    e = model.expressions()
    states = [dimensions_of(s.unit) for s in model.states]
    given = {
        0: states, 1: [dimensions_of(i.unit) for i in model.inputs],
        2: [dimensions_of(p.unit) for p in model.parameters],
        3: [dimensions_of(n.unit) for n in effect.parameters] if effect else [],
    }  # fmt: skip
    made = [ca.densify(part) for part in (e.rate, e.readings, e.outputs, e.initial, e.mapped)]
    found = carried(ca.Function("units", [e.x, e.u, e.p, e.g], made), given)
    wanted = [
        [per_second(s) for s in states],
        [dimensions_of(s.unit) for s in model.sensors],
        [dimensions_of({"power": "W"}.get(name, "Nm")) for name in model.outputs],
        states,
        states,
    ]
    for has, should in zip(found, wanted, strict=True):
        assert all(balances(a, b) for a, b in zip(has, should, strict=True)), (has, should)


def test_the_generator_knows_the_same_effects() -> None:
    assert set(EFFECTS) == set(LIBRARY)
    for name, effect in LIBRARY.items():
        assert set(EFFECTS[name].parameters) == {n.key for n in effect.parameters}
        assert EFFECTS[name].one_sided == all(n.one_sided for n in effect.gains)


def test_torque_opposes_slip() -> None:
    """With wind-up and slip of one sign, whatever the size of an effect on the torque."""
    for name in ("friction_level", "friction_slip", "friction_oil_temperature", "viscous_drag"):
        effect = LIBRARY[name]
        model = ALSD.with_effects((effect,))
        e = model.expressions()
        torque = ca.Function("T", [e.x, e.u, e.p, e.g], [e.quantities.clutch_torque])
        rng = np.random.default_rng(6)
        for sign in (-1.0, 1.0):
            for gain in (-1.0, 0.0, 1.0) if not effect.gains[0].one_sided else (0.0, 1.0):
                x, u, p = point(ALSD, rng)
                x[model.state("wind_up")] *= sign
                u[model.input("slip_speed")] *= sign
                assert float(torque(x, u, p, numbers(effect, gain))) * sign > 0
