"""A DC motor that turns a load: a machine of one's own in one file.

The equations: Krause, Wasynczuk, Sudhoff, "Analysis of Electric Machinery and Drive Systems",
chapter 2.  ``docs/machine.md`` builds this file step by step.
"""

import casadi as ca
import numpy as np

from clutchest import machine as cm


def electrical(q):
    """L di/dt = U − R i − K ω."""
    q.resistance_now = q.resistance * (1 + 0.0039 * (q.temp_winding - 25.0))  # copper
    q.back_emf = q.torque_constant * q.speed
    drop = q.resistance_now * q.current
    q.current_rate = (q.voltage - drop - q.back_emf) / (1e-3 * q.inductance)
    q.current_reading = q.current


def mechanical(q):
    """J dω/dt = K i − T_C sgn ω − b ω; the sign turns smoothly within 2 rad/s."""
    q.coulomb_now = q.coulomb_torque
    q.friction = q.coulomb_now * ca.tanh(q.speed / 2.0) + q.viscous * q.speed
    q.motor_torque = q.torque_constant * q.current
    q.speed_rate = (q.motor_torque - q.friction) / q.inertia
    q.speed_reading = q.speed
    q.measured_torque = q.inertia * q.acceleration + q.friction


def thermal(q):
    """C dT/dt = R i² − G (T − T_0)."""
    q.heat = q.resistance_now * q.current**2
    cooling = q.conductance * (q.temp_winding - q.ambient_temp)
    q.temp_winding_rate = (q.heat - cooling) / q.heat_capacity


MODEL = cm.Model(
    "servo",
    states=(  # name, unit, symbol, what, process noise (unit/√s), initial std, useful std
        cm.State("current", "A", "i", "winding", 0.02, 1.0, 1.0, stiff=True),
        cm.State("speed", "rad/s", "ω", "shaft", 0.05, 1.0, 5.0),
        cm.State("temp_winding", "°C", "T", "winding", 0.01, 5.0, 10.0, parked_noise=0.1),
    ),
    parameters=(
        cm.Parameter("resistance", "Ohm", "R", "of the winding at 25 °C", 0.01),
        cm.Parameter("inductance", "mH", "L", "of the winding", 0.01),
        cm.Parameter("torque_constant", "Nm/A", "K", "torque per current", 0.001),
        cm.Parameter("inertia", "kg m^2", "J", "of rotor and load", 1e-6),
        cm.Parameter("coulomb_torque", "Nm", "T_C", "dry friction", 0.0),
        cm.Parameter("viscous", "Nm s/rad", "b", "viscous friction", 0.0),
        cm.Parameter("heat_capacity", "J/K", "C", "of the winding", 1.0),
        cm.Parameter("conductance", "W/K", "G", "from winding to air", 0.0),
    ),
    inputs=(
        cm.Input("voltage", "V", "U", "at the terminals"),
        cm.Input("ambient_temp", "°C", "T_0", "air", default=25.0, gap=60.0),
        cm.Input("acceleration", "rad/s^2", "dω/dt", "slope of the measured speed", default=0.0),
    ),
    sensors=(cm.Sensor("speed", "rad/s", "ω", "shaft"), cm.Sensor("current", "A", "i", "winding")),
    pieces=(electrical, mechanical, thermal),
    anchor="speed",
    slopes={"acceleration": "speed"},
    longest=(0.001, 0.001),
)


class CoulombChange(cm.Effect):
    """T_C × (1 + ``change``): a bearing that runs dry, a brake that drags."""

    name, equation, scales = "coulomb_change", "friction", {"coulomb_now": "change"}
    parameters = (cm.Number("change", "1", -0.5, 2.0, healthy=0.05),)


class Stribeck(cm.Effect):
    """T_C × (1 + ``change`` · exp(−|ω|/``speed``)): more friction where the shaft turns slowly."""

    name, equation = "stribeck", "friction"
    parameters = (
        cm.Number("change", "1", -0.5, 2.0),
        cm.Number("speed", "rad/s", 2.0, 50.0, shape=True, default=10.0, grid=(5.0, 10.0, 20.0)),
    )

    def terms(self, g):
        return {"coulomb_now": lambda t, q: t * (1 + g.change * ca.exp(-abs(q.speed) / g.speed))}


class CurrentGain(cm.Effect):
    """The current sensor reads i × (1 + ``change``)."""

    name, equation, scales = "current_gain", "sensor:current", {"current_reading": "change"}
    parameters = (cm.Number("change", "1", -0.3, 0.3),)


def mixed(rng, time, parameters):
    """Smooth random voltage, the shaft turning now one way and now the other."""
    rate, phase = rng.uniform(0.05, 1.0, (8, 1)), rng.uniform(0.0, 2 * np.pi, (8, 1))
    voltage = 5.0 * np.sin(2 * np.pi * rate * time + phase).sum(axis=0)
    return {"voltage": voltage, "ambient_temp": np.full(len(time), 22.0)}


MACHINE = cm.Machine.of(
    MODEL,
    "DC motor with a load",
    at_rest=lambda parameters, inputs: {"temp_winding": inputs["ambient_temp"]},
    error_terms=(
        cm.ErrorTerm("current", {"back_emf": lambda value, g: value + 0.2 * g}),  # V
        cm.ErrorTerm("friction", {"friction": lambda value, g: value + 0.01 * g}),  # Nm
        cm.ErrorTerm("heat", {"heat": lambda value, g: value + 2.0 * g}, slow=True),  # W
        cm.ErrorTerm("timing:voltage", late=("voltage", 0.005)),
    ),
    covariates={"motor_torque": "Nm"},
    compared=cm.Comparison("measured_torque", "motor_torque", "Nm", "motor torque"),
    effects=(CoulombChange(), Stribeck(), CurrentGain()),
    faults=(cm.ModelFault("coulomb_change", CoulombChange(), "change", 0.3, (16, 18)),),
    excitations={"mixed": mixed},
)
