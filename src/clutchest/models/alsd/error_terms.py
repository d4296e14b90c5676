"""Errors of the differential's equations that no effect describes."""

from __future__ import annotations

from collections.abc import Mapping

from clutchest.models.declarations import Separation
from clutchest.models.error_terms import ErrorTerm

# An error correlates with what it is made from.  No bristle is among that: how far one is bent
# follows from which way the motor turned last, and from noise of the readings that correct it.
_CURRENT = ("current", "motor_speed", "temp_armature", "oil_temp", "time")
_MOTOR = (
    "motor_speed",
    "motor_angle",
    "motor_angle_in_turn",
    "motor_torque",
    "temp_armature",
    "oil_temp",
    "time",
)
_AXIAL = (
    "pack_force",
    "motor_angle",
    "motor_speed",
    "slip_speed",
    "temp_pack",
    "oil_temp",
    "energy",
    "time",
)
_TORQUE = (
    "slip_speed",
    "pack_force",
    "pressed_time",
    "motor_torque",
    "temp_pack",
    "temp_pack_peak",
    "oil_temp",
    "energy",
    "time",
)
_DRAG = ("slip_speed", "gap", "pack_force", "oil_temp")
_ANGLE_SENSOR = ("motor_angle", "motor_angle_in_turn", "temp_armature", "oil_temp", "time")
_CURRENT_SENSOR = ("current", "temp_armature", "oil_temp", "time")
_CLOCK = ("time",)
ERROR_TERMS: Mapping[str, ErrorTerm] = {
    "torque": ErrorTerm(
        "torque",
        {"friction_now": lambda value, g: value * (1 + 0.1 * g)},
        covariates=_TORQUE,
        size=10.0,
        unit="%",
    ),
    "drag": ErrorTerm(
        "torque",
        {"drag_level": lambda value, g: value + 5.0 * g},
        covariates=_DRAG,
        size=5.0,
        unit="Nm",
    ),
    "current": ErrorTerm(
        "current",
        {"motor_voltage": lambda value, g: value - 0.2 * g},
        covariates=_CURRENT,
        size=0.2,
        unit="V",
    ),
    "current, supply": ErrorTerm(
        "current",
        {"motor_voltage": lambda value, g: value * (1 - 0.05 * g)},
        covariates=_CURRENT,
        size=5.0,
        unit="%",
    ),
    "motor": ErrorTerm(
        "motor",
        {"motor_friction_torque": lambda value, g: value + 0.005 * g},
        covariates=_MOTOR,
        size=0.005,
        unit="Nm",
    ),
    "axial_force": ErrorTerm(
        "axial_force",
        {"ball_ramp_torque": lambda value, g: value * (1 + 0.05 * g)},
        covariates=_AXIAL,
        size=5.0,
        unit="%",
    ),
    "pack_heat": ErrorTerm(
        "pack_heat",
        {"pack_heat": lambda value, g: value + 200.0 * g},
        covariates=("slip_speed", "temp_pack", "oil_temp", "energy", "time"),
        slow=True,
        size=200.0,
        unit="W",
    ),
    "sensor:motor_angle": ErrorTerm(
        "sensor:motor_angle",
        {"motor_angle_reading": lambda value, g: value + 0.1 * g},
        covariates=_ANGLE_SENSOR,
        size=0.1,
        unit="rad",
    ),
    "sensor:armature_current": ErrorTerm(
        "sensor:armature_current",
        {"armature_current_reading": lambda value, g: value + 0.3 * g},
        covariates=_CURRENT_SENSOR,
        size=0.3,
        unit="A",
    ),
    "timing:armature_voltage": ErrorTerm(
        "timing:armature_voltage", late=("armature_voltage", 0.005), covariates=_CLOCK
    ),
    "timing:slip_speed": ErrorTerm(
        "timing:slip_speed", late=("slip_speed", 0.005), covariates=_CLOCK
    ),
}

SEPARATING_SENSORS = (
    Separation(("torque", "axial_force"), "a force sensor in the clutch pack"),
    Separation(("motor", "axial_force"), "a torque sensor on the actuator's motor"),
)
SENSOR_FOR = {"": "a torque sensor on the half-shaft"}
COVARIATES = {"slip_speed": "rad/s", "motor_torque": "Nm", "pack_force": "N", "gap": "m"}
RATES = {"voltage_rate": "armature_voltage"}
PEAKS = {"temp_pack_peak": "temp_pack"}
TURNS = {"motor_angle_in_turn": "motor_angle"}
DURATIONS = {"pressed_time": "pack_force"}
