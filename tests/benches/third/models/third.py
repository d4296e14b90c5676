"""A dry plate on a shaft: slip speed and temperature, one sensor."""

from __future__ import annotations

import casadi as ca

from clutchest.models.error_terms import ErrorTerm
from clutchest.models.model import Model, Quantities
from clutchest.models.symbols import Input, Parameter, Sensor, State

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
COLUMNS = (("slip_speed", "rad/s"), ("drive_torque", "Nm"), ("air_temp", "°C"))
APART = ()


def plate(q: Quantities) -> None:
    """J dω_s/dt = T_d − T_c, C dϑ/dt = T_c ω_s − G (ϑ − ϑ_0)."""
    q.sliding_torque = q.friction_torque
    q.clutch_torque = q.sliding_torque * ca.tanh(q.slip_speed / q.sticking_speed)
    q.power = q.clutch_torque * q.slip_speed
    q.slip_speed_rate = (q.drive_torque - q.clutch_torque) / q.inertia
    q.temp_rate = (q.power - q.conductance * (q.temp - q.air_temp)) / q.heat_capacity
    q.slip_speed_reading = q.slip_speed


def for_signals(names):
    return Model(
        "third",
        STATES,
        PARAMETERS,
        INPUTS,
        (),
        SENSORS,
        ("clutch_torque", "power"),
        (plate,),
        anchor="slip_speed",
        hottest="temp",
    )


def resting(parameters, inputs):
    return {"temp": inputs["air_temp"]}


ERROR_TERMS = {
    "torque": ErrorTerm("torque", {"sliding_torque": lambda value, g: value * (1 + 0.1 * g)}),
    "timing:drive_torque": ErrorTerm("timing:drive_torque", late=("drive_torque", 0.01)),
}
TOLD_APART_BY = ()
DRIVERS = ()
RATES = {}
PEAKS = {}
