"""A dry plate on a shaft, as a user would write it: slip speed and temperature, one sensor."""

from __future__ import annotations

import casadi as ca

from clutchest.machine import (
    Column,
    Effect,
    ErrorTerm,
    Input,
    Machine,
    Model,
    Number,
    Parameter,
    Quantities,
    Sensor,
    State,
)

STATES = (
    State("slip_speed", "rad/s", "ω_s", "slip", 1.0, 1.0, 5.0),
    State("temp", "°C", "ϑ", "plate", 0.1, 10.0, 10.0),
)
PARAMETERS = (
    Parameter("inertia", "kg m^2", "J", "driven shaft"),
    Parameter("friction_torque", "Nm", "T_C", "friction"),
    Parameter("sticking_speed", "rad/s", "ω_0", "over which friction turns its sign"),
    Parameter("heat_capacity", "J/K", "C", "plate"),
    Parameter("conductance", "W/K", "G", "plate to air"),
)
INPUTS = (
    Input("drive_torque", "Nm", "T_d", "what drives the shaft"),
    Input("air_temp", "°C", "ϑ_0", "air", default=20.0, gap=60.0),
)
SENSORS = (Sensor("slip_speed", "rad/s", "ω_s", "slip"),)


def plate(q: Quantities) -> None:
    """J dω_s/dt = T_d − T_c, C dϑ/dt = T_c ω_s − G (ϑ − ϑ_0)."""
    q.sliding_torque = q.friction_torque
    q.clutch_torque = q.sliding_torque * ca.tanh(q.slip_speed / q.sticking_speed)
    q.power = q.clutch_torque * q.slip_speed
    q.slip_speed_rate = (q.drive_torque - q.clutch_torque) / q.inertia
    q.temp_rate = (q.power - q.conductance * (q.temp - q.air_temp)) / q.heat_capacity
    q.slip_speed_reading = q.slip_speed


MODEL = Model(
    "third",
    STATES,
    PARAMETERS,
    INPUTS,
    SENSORS,
    pieces=(plate,),
    outputs=("clutch_torque", "power"),
    anchor="slip_speed",
)


class Fade(Effect):
    """T_C × exp(−``slope`` · (ϑ − 20)/100)."""

    name = "fade"
    model = "third"
    equation = "torque"
    parameters = (Number("slope", "1/(100 K)", -0.5, 0.5),)

    def terms(self, g):
        return {
            "sliding_torque": lambda torque, q: torque * ca.exp(-g.slope * (q.temp - 20.0) / 100.0)
        }


MACHINE = Machine(
    name="third",
    what="dry plate on a shaft",
    states=STATES,
    parameters=PARAMETERS,
    inputs=INPUTS,
    sensors=SENSORS,
    columns=(
        Column("slip_speed", "rad/s"),
        Column("drive_torque", "Nm"),
        Column("air_temp", "°C"),
    ),
    equations=lambda signals: MODEL,
    at_rest=lambda parameters, inputs: {"temp": inputs["air_temp"]},
    error_terms={
        "torque": ErrorTerm("torque", {"sliding_torque": lambda value, g: value * (1 + 0.1 * g)}),
        "timing:drive_torque": ErrorTerm("timing:drive_torque", late=("drive_torque", 0.01)),
    },
    effects={"fade": Fade()},
)
