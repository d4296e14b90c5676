"""The model that the estimator of the differential runs on, and its forms for fewer signals."""

from __future__ import annotations

from collections.abc import Container, Mapping
from dataclasses import replace

from clutchest.models.alsd import driveline
from clutchest.models.alsd.parameters import PARAMETERS
from clutchest.models.alsd.reduced import PIECES, slip_measured
from clutchest.models.alsd.symbols import INPUTS, SENSORS, STATES, WHEELS
from clutchest.models.model import Model

# Parameters of bristles, servo and controllers: of the full model alone.
FULL_MODEL_ONLY = {
    "motor_bristle_stiffness",
    "motor_bristle_damping",
    "ball_ramp_exponent",
    "limiter_stiffness",
    "supply_voltage",
    "clutch_static_ratio",
    "clutch_stribeck_speed",
    "final_drive_ratio",
    "structure_inertia",
    "case_inertia",
    "structure_stiffness",
    "driveline_friction",
    "current_proportional",
    "current_integral",
    "servo_proportional",
    "servo_integral",
    "servo_torque_limit",
}

ALSD = Model(
    name="alsd",
    states=STATES,
    parameters=tuple(p for p in PARAMETERS if p.key not in FULL_MODEL_ONLY),
    inputs=INPUTS,
    sensors=SENSORS,
    outputs=("friction_potential", "transmitted_torque", "power"),
    pieces=PIECES,
    anchor="motor_angle",
    longest=(1e-3, 1e-3),
    doubted=("free_play",),
)

_NO_SLIP = "no slip speed and no wheel speeds, so that torque and its heat are unknown"
_NO_TORQUE = "no torque signal: the actuator informs the force alone, not the friction"


def for_signals(names: Container[str]) -> Model:
    """The form of the equations that the available signals can drive."""
    return driven_by(ALSD, names)


def driven_by(model: Model, names: Container[str]) -> Model:
    """The form of a ``model``, the filter's or the fitted one, that the available signals can
    drive."""
    if "slip_speed" not in names and "wheel_speed_left" in names:
        inputs = (INPUTS[0], *WHEELS, INPUTS[2])
        model = replace(model.swap(slip_measured, driveline.car), inputs=inputs)
    if "clutch_torque" not in names and "shaft_torque" not in names:
        model = model.unobserved({"friction": _NO_TORQUE})
    return model


def at_rest(parameters: Mapping[str, float], inputs: Mapping[str, float]) -> dict[str, float]:
    """State at the start of a drive: the actuator at home, everything as warm as the oil."""
    oil = inputs["oil_temp"]
    return {
        "free_play": parameters["free_play"],
        "friction": 1.0,
        "temp_pack": oil,
        "temp_armature": oil,
    }
