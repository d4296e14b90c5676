"""§ V-A and V-C: how far heat warms and expands the body, and how fast disc and body follow."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp

from clutchest.models.dry_clutch.equations import DRY_CLUTCH, power_modelled, two_state
from clutchest.models.model import Model, Quantities
from clutchest.reproduce.claim import Claim, Verdict
from clutchest.reproduce.me12.data import Setup, changed
from clutchest.signals import Floats
from clutchest.vehicle import Vehicle

HEATING = 1.5e6  # J
HEATER = 1e4  # W
EXPANSION = 0.3  # mm
INSULATED = {"conductance_engine_body": 0.0, "conductance_body_housing": 0.0}
HELD = {"heat_capacity_housing": 1e12}  # J/K: the housing stays as it is
RISEN = 1.0 - np.exp(-1.0)  # of a step's end, after one time constant
BOTH = DRY_CLUTCH.state("temp_body"), DRY_CLUTCH.state("temp_disc")


def heated(q: Quantities) -> None:
    """A heater in the place of the slip."""
    q.power = HEATER


def heating(model: Model, vehicle: Vehicle, span: float, rows: int) -> tuple[Floats, Floats]:
    """(time s (rows,), states (rows, n)) of a clutch at rest, all at 70 °C, heated from 0 s on."""
    e = model.swap(power_modelled, heated).expressions()
    rate = ca.Function("rate", [e.x, e.u, e.w, e.p, e.g], [e.rate])
    p = [vehicle.parameters[q.key].value for q in model.parameters]
    rest = vehicle.parameters["reference_temp"].value
    u = [rest if item.unit == "°C" else 0.0 for item in model.inputs]
    start = [rest if state.unit == "°C" else 0.0 for state in model.states]
    time = np.linspace(0.0, span, rows)
    way = solve_ivp(
        lambda t, x: np.array(rate(x, u, np.zeros(len(model.regime)), p, [])).ravel(),
        (0.0, span),
        start,
        t_eval=time,
        method="LSODA",
        rtol=1e-8,
        atol=1e-8,
    )
    return time, way.y.T


def adiabatic(setup: Setup) -> Verdict:
    """D5: the two-state model (6), (7), (9), insulated."""
    vehicle = changed(setup.vehicle, **INSULATED)
    model = two_state(DRY_CLUTCH)
    _, x = heating(model, vehicle, HEATING / HEATER, 1501)
    warmer = x[:, BOTH[0]] - x[0, BOTH[0]]
    grown = vehicle.parameters["expansion_body"].value * warmer
    by_expansion = float(np.interp(EXPANSION, grown, warmer))
    return Verdict(
        f"{warmer[-1]:.1f} K for 1.5 MJ, {by_expansion:.1f} K for 0.3 mm",
        36.5 <= warmer[-1] <= 37.5 and 30.0 <= by_expansion <= 32.0,
        {"by_energy_K": float(warmer[-1]), "by_expansion_K": by_expansion},
    )


def time_constants(setup: Setup) -> Verdict:
    """D6: the three-state model, housing held, after the heat has been switched on."""
    vehicle = changed(setup.vehicle, **HELD)
    p = {key: value.value for key, value in vehicle.parameters.items()}
    time, x = heating(DRY_CLUTCH, vehicle, 20_000.0, 200_001)
    body, disc = x[:, BOTH[0]], x[:, BOTH[1]] - x[:, BOTH[0]]
    fast, slow = (
        float(np.interp(RISEN, y / y[-1], time)) for y in (disc - disc[0], body - body[0])
    )
    by_numbers = (
        p["heat_capacity_disc"] / p["conductance_disc_body"],
        p["heat_capacity_body"] / (p["conductance_engine_body"] + p["conductance_body_housing"]),
    )
    return Verdict(
        f"{fast:.1f} s and {slow:.0f} s, a factor of {slow / fast:.0f} "
        f"(C/k: {by_numbers[0]:.1f} s and {by_numbers[1]:.0f} s)",
        45.0 <= slow / fast <= 60.0 and 10.0 <= fast <= 25.0 and 600.0 <= slow <= 1500.0,
        {"disc_s": fast, "body_s": slow, "factor": slow / fast},
    )


def _times(key: str, factor: float) -> Callable[[Setup], Setup]:
    """The setup with a parameter ``factor`` times as large."""
    return partial(_scaled, key=key, factor=factor)


def _scaled(setup: Setup, key: str, factor: float) -> Setup:
    return setup.modelled(**{key: factor * setup.vehicle.parameters[key].value})


CLAIMS = (
    Claim(
        "D5",
        "body warmed by 1.5 MJ without cooling; warming that expands it by 0.3 mm",
        "§ V-A",
        "37 K (accepted 36.5–37.5); 30 K, 31.0 by its own numbers (accepted 30–32)",
        adiabatic,
        {
            "5 % more body": _times("heat_capacity_body", 1.05),
            "5 % less expansion": _times("expansion_body", 0.95),
        },
    ),
    Claim(
        "D6",
        "time constants of disc and body in a step response",
        "§ V-C",
        "a factor of about 50 (accepted 45–60); disc 10–25 s, body 600–1500 s",
        time_constants,
        {
            "a quarter more disc": _times("heat_capacity_disc", 1.25),
            "a quarter less body": _times("heat_capacity_body", 0.75),
        },
    ),
)
