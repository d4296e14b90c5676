"""Two tanks, one after the other: a model that is linear, small and quick to compile."""

from __future__ import annotations

from functools import cache
from types import ModuleType

import numpy as np

from clutchest import generated
from clutchest.compute import build
from clutchest.models.machine import Machine
from clutchest.models.model import Model, Quantities
from clutchest.models.symbols import Column, Input, Parameter, Sensor, State


def flow(q: Quantities) -> None:
    """Water runs in, from the first tank to the second, and out."""
    q.upper_rate = q.inflow - q.leak * q.upper
    q.lower_rate = q.leak * q.upper - q.drain * q.lower
    q.total = q.upper + q.lower
    q.power = 3.0 * q.upper


def gauges(q: Quantities) -> None:
    """One tank, and both together."""
    q.upper_level_reading = q.upper
    q.weight_reading = q.upper + 2.0 * q.lower


TANKS = Model(
    name="tanks",
    states=(
        State("upper", "m", "a", "level of the upper tank", 0.1, 1.0, 1.0),
        State("lower", "m", "b", "level of the lower tank", 0.1, 1.0, 1.0),
    ),
    parameters=(
        Parameter("leak", "1/s", "k", "upper to lower"),
        Parameter("drain", "1/s", "d", "out of the lower"),
    ),
    inputs=(Input("inflow", "m/s", "v", "into the upper"),),
    anchor="upper_level",
    sensors=(
        Sensor("upper_level", "m", "a", "upper level"),
        Sensor("weight", "m", "w", "both, weighed"),
    ),
    outputs=("total", "power"),
    pieces=(flow, gauges),
)
MACHINE = Machine(
    name="tanks",
    what="two tanks",
    states=TANKS.states,
    parameters=TANKS.parameters,
    inputs=TANKS.inputs,
    sensors=TANKS.sensors,
    columns=(
        Column("inflow", "m/s"),
        Column("upper_level", "m"),
        Column("weight", "m"),
    ),
    equations=lambda signals: TANKS,
)
NUMBERS = np.array([0.7, 0.3])  # leak, drain
A = np.array([[-0.7, 0.0], [0.7, -0.3]])
B = np.array([[1.0], [0.0]])
H = np.array([[1.0, 0.0], [1.0, 2.0]])


@cache
def compiled() -> tuple[str, ModuleType]:
    """Digest and functions of the two tanks, with no thetas."""
    digest, text = build.generate(TANKS, ())
    return digest, generated.load(digest, text)


def rates(
    functions: ModuleType, x: tuple[float, float], inflow: float, **gains: float
) -> list[float]:
    """dx/dt as the compiled function has it."""
    f, a, b = np.zeros(2), np.zeros((2, 2)), np.zeros((2, 1))
    g, w = np.array([*gains.values()]), np.zeros(0)
    functions.dynamics(np.array(x), np.array([inflow]), w, NUMBERS, g, f, a, b)
    return f.tolist()
