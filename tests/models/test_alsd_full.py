"""The whole active differential: its step against scipy, its energy, its friction laws."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from itertools import pairwise

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from clutchest.compute.forward import Forward, forward
from clutchest.errors import ClutchestError
from clutchest.models.alsd import driveline, full, pack
from clutchest.models.alsd.friction import LAWS, karnopp, lugre, reset_integrator
from clutchest.models.model import Model
from clutchest.vehicle import load_vehicle

from . import alsd_energy

Columns = dict[str, NDArray[np.float64]]
WATCHED = ("pack_force", "motor_angle", "current", "clutch_torque")
SHOWN = (
    *WATCHED,
    "friction_potential",
    "slip_speed",
    "ball_ramp_force",
    "spring_force",
    "bristle_stiffness",
)
PERIOD = 1e-3
OIL = 25.0
STEPS = (0.5, 0.501, 1.3, 1.301, 2.1)  # A1: request up, request down


@cache
def rig() -> dict[str, float]:
    return {key: value.value for key, value in load_vehicle("alsd_rig").parameters.items()}


def compiled(model: Model = full.RIG, watched: tuple[str, ...] = SHOWN) -> Forward:
    return forward(model, watched)


def request(t: NDArray[np.float64], amps: float) -> NDArray[np.float64]:
    return np.interp(t, STEPS[:4], (0.0, amps, amps, 0.0))


def drive(
    model: Forward,
    inputs: Mapping[str, NDArray[np.float64]],
    slip: float,
    steps: int = 20,
    **changed: float,
) -> Columns:
    parameters = {**rig(), **changed}
    start = full.rest(model.model, parameters["free_play"], OIL)
    start["drive_speed"] = slip * parameters["final_drive_ratio"]
    rows = len(next(iter(inputs.values())))
    given = {"oil_temp": np.full(rows, OIL), **inputs}
    return model.run(parameters, start, given, PERIOD, steps)


def step_response(
    amps: float, rpm: float = 25.0, steps: int = 20, model: Forward | None = None, **changed: float
) -> tuple[NDArray[np.float64], Columns]:
    t = np.arange(round(STEPS[-1] / PERIOD) + 1) * PERIOD
    slip = rpm * np.pi / 30
    inputs = {"current_request": request(t, amps), "slip_request": np.full(len(t), slip)}
    return t, drive(model or compiled(), inputs, slip, steps, **changed)


# --- the step ---


def reference(method: str, amps: float, rpm: float, stiffness: float = 1e6) -> Columns:
    """The same equations by scipy, resets as a stiff pull towards what they allow."""
    e = full.RIG.expressions()
    reset = ca.substitute(e.mapped, e.u0, e.u)
    rate = e.rate + stiffness * (reset - e.x)
    f = ca.Function("f", [e.x, e.u, e.p], [rate])
    jacobian = ca.Function("j", [e.x, e.u, e.p], [ca.jacobian(rate, e.x)])
    shown = ca.vertcat(*(getattr(e.quantities, name) for name in WATCHED))
    show = ca.Function("s", [e.x, e.u, e.p], [shown])
    p = np.array([rig()[q.key] for q in full.RIG.parameters])
    slip = rpm * np.pi / 30
    start = full.rest(full.RIG, rig()["free_play"], OIL)
    start["drive_speed"] = slip * rig()["final_drive_ratio"]
    x = np.array([start[state.name] for state in full.RIG.states])
    scale = np.array([{"m": 1e-5, "rad": 1e-3}.get(s.unit, 1.0) for s in full.RIG.states])

    def at(t: float) -> NDArray[np.float64]:
        return np.array([float(request(np.array(t), amps)), slip, OIL])

    grid = np.arange(round(STEPS[-1] / PERIOD) + 1) * PERIOD
    rows: dict[int, NDArray[np.float64]] = {}
    for a, b in pairwise((0.0, *STEPS)):
        wanted = grid[(grid > a - 1e-9) & (grid < b + 1e-9)]
        solution = solve_ivp(
            lambda t, x: np.array(f(x, at(t), p)).ravel(),
            (a, b),
            x,
            method=method,
            jac=lambda t, x: np.array(jacobian(x, at(t), p)),
            t_eval=np.clip(wanted, a, b),
            rtol=1e-7,
            atol=1e-9 * scale,
        )
        assert solution.success
        x = solution.y[:, -1]
        for time, column in zip(wanted, solution.y.T, strict=True):
            rows[round(time / PERIOD)] = np.array(show(column, at(time), p)).ravel()
    return dict(zip(WATCHED, np.array([rows[k] for k in range(len(grid))]).T, strict=True))


def furthest(result: Columns, wanted: Columns) -> dict[str, float]:
    """Largest difference over full scale."""
    return {
        name: float(np.abs(result[name] - wanted[name]).max() / np.abs(wanted[name]).max())
        for name in WATCHED
    }


@pytest.mark.parametrize(
    ("method", "amps", "rpm"),
    [
        ("LSODA", 12.0, 25.0),
        pytest.param("LSODA", 12.0, 0.5, marks=pytest.mark.slow),
        pytest.param("Radau", 12.0, 25.0, marks=pytest.mark.slow),
    ],
)
def test_the_step_agrees_with_scipy(method: str, amps: float, rpm: float) -> None:
    """1e-3 of full scale over A1 and A4, at 50 µs a step."""
    _, result = step_response(amps, rpm)
    differences = furthest(result, reference(method, amps, rpm))
    assert max(differences.values()) < 1e-3, differences


def test_the_step_converges_with_its_order() -> None:
    """Second order, kinks of contacts and resets included: half the step, a quarter the error."""
    fine = step_response(12.0, steps=320)[1]
    errors = [furthest(step_response(12.0, steps=n)[1], fine) for n in (10, 20, 40)]
    for name in WATCHED:
        orders = [np.log2(a[name] / b[name]) for a, b in pairwise(errors)]
        assert min(orders) > 1.6, (name, orders)


# --- energy ---


def test_energy_is_balanced() -> None:
    """Through play at both gears, an engagement, a reversal of slip under load, and a release."""
    accounted = replace(full.RIG, pieces=(*full.RIG.pieces, alsd_energy.account))
    heats = ("heat_armature", "heat_motor_friction", "heat_film", "heat_driveline")
    watched = (
        "electrical_power",
        "servo_power",
        "stored_energy",
        *heats,
        "work_ball_ramp",
        "work_clutch",
        "wind_up",
        "deflection",
        "ball_ramp_bristle",
        "clutch_torque",
        "contact",
        "current",
        "ball_ramp_friction_torque",
        "friction_potential",
    )
    fine = 2e-5
    t = np.arange(round(1.6 / fine) + 1) * fine
    slip = np.interp(t, (0.0, 0.7, 0.9), (2.6, 2.6, -2.6))
    inputs = {
        "current_request": np.interp(t, (0.2, 0.201, 1.2, 1.201), (0.0, 9.0, 9.0, 0.0)),
        "slip_request": slip,
        "oil_temp": np.full(len(t), OIL),
    }
    # at the reference temperature, where K_t = K_v
    parameters = {**rig(), "armature_reference_temp": OIL, "armature_heat_capacity": 1e9}
    start = full.rest(accounted, parameters["free_play"], OIL)
    start["drive_speed"] = 2.6 * parameters["final_drive_ratio"]
    o = compiled(accounted, watched).run(parameters, start, inputs, fine)

    def gathered(power: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.append(0.0, np.cumsum(power[1:] + power[:-1])) * fine / 2

    def kept(torque: NDArray[np.float64], bristle: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.append(0.0, np.cumsum((torque[1:] + torque[:-1]) / 2 * np.diff(bristle)))

    ball_ramp = gathered(o["work_ball_ramp"]) - kept(
        o["ball_ramp_friction_torque"], o["ball_ramp_bristle"]
    )
    clutch = gathered(o["work_clutch"]) - kept(o["clutch_torque"], o["deflection"])
    warm = {name: gathered(o[name]) for name in heats}
    put_in = gathered(o["electrical_power"]) + gathered(o["servo_power"])
    spent = sum(warm.values()) + ball_ramp + clutch + o["stored_energy"] - o["stored_energy"][0]
    scale = np.abs(gathered(np.abs(o["electrical_power"]) + np.abs(o["servo_power"])))[-1]
    assert np.abs(put_in - spent).max() < 1e-3 * scale
    # friction never gives: every part of the heat grows
    for name, heat in {**warm, "ball ramp": ball_ramp, "clutch": clutch}.items():
        assert np.diff(heat).min() > -1e-6 * scale, name
        assert heat[-1] > 0, name
    # the run had what it is meant to have
    assert {0.0, 1.0} == set(np.unique(o["contact"]))
    crossed = np.abs(o["wind_up"]) < 0.9 * rig()["differential_backlash"]
    loaded = (t > 0.3) & (t < 1.2)
    assert crossed[loaded].any() and np.ptp(np.sign(o["clutch_torque"][loaded])) == 2
    falling = (t > 1.2) & (o["friction_potential"] > 50)
    assert np.allclose(np.abs(o["clutch_torque"][falling]), o["friction_potential"][falling])


# --- friction laws ---


@pytest.mark.statistics
@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_every_law_slides_with_the_friction_potential(law: object) -> None:
    """At steady slip all laws agree: T_c = T_C (LuGre's within its Stribeck effect)."""
    model = full.RIG_APART.swap(reset_integrator, law)  # type: ignore[arg-type]
    _, o = step_response(7.0, model=compiled(model))
    held = o["clutch_torque"][1290] / o["friction_potential"][1290]
    assert held == pytest.approx(1.0, rel=2e-3)
    assert o["friction_potential"][1290] > 1000
    assert np.abs(o["clutch_torque"][-1]) < 1.0


@pytest.mark.statistics
@pytest.mark.parametrize(
    ("law", "softer"), [(karnopp, 0.05), (lugre, 0.15)], ids=["karnopp", "lugre"]
)
def test_the_structure_apart_winds_up_as_the_lumped_bristle_does(
    law: object, softer: float
) -> None:
    """At creeping slip, before break-away; LuGre's bristle yields before it slides."""
    lumped = step_response(12.0, rpm=0.5, differential_backlash=0.0)[1]["clutch_torque"]
    model = full.RIG_APART.swap(reset_integrator, law)  # type: ignore[arg-type]
    # a rigid law has no compliance of its own: the structure then has all of it
    structure = 40001.0 if law is karnopp else rig()["structure_stiffness"]
    bristle = rig()["torsional_stiffness"]
    o = step_response(
        12.0,
        0.5,
        model=compiled(model),
        structure_stiffness=structure,
        torsional_stiffness=bristle,
        differential_backlash=0.0,
    )[1]["clutch_torque"]
    late = slice(800, 1290)
    assert lumped[800] > 400
    assert np.all(o[late] < 1.02 * lumped[late])
    assert np.all(o[late] > (1 - softer) * lumped[late])


@pytest.mark.slow
def test_stuck_surfaces_carry_what_drives_them() -> None:
    """Under a servo torque below the potential the clutch holds: reset integrator and Karnopp."""
    t = np.arange(1501) * PERIOD
    torque = np.interp(t, (0.5, 0.6), (0.0, 300.0))
    inputs = {"current_request": np.interp(t, (0.0, 0.01), (0.0, 7.0)), "drive_torque": torque}
    wanted = rig()["final_drive_ratio"] * (300.0 - rig()["driveline_friction"])
    model = compiled(full.on_drive_torque(full.RIG))
    o = drive(model, inputs, 0.0, structure_inertia=0.05)
    settled = slice(1300, 1500)
    assert o["friction_potential"][1400] > 1.05 * wanted
    assert np.mean(o["clutch_torque"][settled]) == pytest.approx(wanted, rel=0.02)
    assert abs(np.mean(o["slip_speed"][settled])) < 0.02


# --- parts ---


def test_the_spring_is_the_gradient_of_its_energy() -> None:
    s = ca.SX.sym("s")
    from clutchest.models.alsd import belleville
    from clutchest.models.model import Quantities

    q = Quantities({})
    for key, value in rig().items():
        setattr(q, key, value)
    gradient = ca.Function("g", [s], [ca.jacobian(belleville.energy(q, s), s)])
    force = ca.Function("f", [s], [belleville.force(q, s)])
    for at in np.linspace(0.0, 3e-3, 7):
        assert float(gradient(at)) == pytest.approx(float(force(at)), rel=1e-9)


@pytest.mark.statistics
def test_without_a_pack_the_spring_alone_loads_the_actuator() -> None:
    model = compiled(full.RIG.swap(pack.pack, pack.no_pack))
    t = np.arange(2001) * PERIOD
    inputs = {"current_request": np.full(len(t), 1.0), "slip_request": np.zeros(len(t))}
    o = drive(model, inputs, 0.0, free_play=1.0)
    assert o["ball_ramp_force"][600] == pytest.approx(o["spring_force"][600], rel=0.05)


@pytest.mark.statistics
def test_the_half_shafts_of_a_car_soften_the_clutch() -> None:
    wound = compiled(full.CAR)
    t = np.arange(1001) * PERIOD
    inputs = {
        "current_request": np.full(len(t), 7.0),
        "wheel_speed_left": np.full(len(t), 31.0),
        "wheel_speed_right": np.full(len(t), 30.0),
    }
    o = drive(wound, inputs, 0.0)
    k, sigma = rig()["halfshaft_stiffness"], rig()["torsional_stiffness"]
    assert o["slip_speed"][5] == pytest.approx(0.5)
    assert o["bristle_stiffness"][0] == pytest.approx(1 / (1 / sigma + 1 / (2 * k)))
    assert o["clutch_torque"][-1] > 1000


def test_what_is_missing_is_named() -> None:
    with pytest.raises(ClutchestError, match="parameter 'gear_ratio' is missing"):
        compiled().run(
            {k: v for k, v in rig().items() if k != "gear_ratio"},
            full.rest(full.RIG, 1e-4, OIL),
            {},
            PERIOD,
        )
    with pytest.raises(ValueError, match="no piece"):
        full.CAR.swap(driveline.rig_lumped, driveline.rig_apart)
