"""The active limited-slip differential of [ID08], equation by equation.

[ID08] V. Ivanović, J. Deur, Z. Herold, M. Hancock, F. Assadian, "Modeling and Experimental
Validation of Active Limited Slip Differential Clutch Dynamics", IMECE2008-67411, ASME 2008.
Equation and figure numbers are the paper's.  One file per part: ``dc_motor`` (1)–(3),
``motor_friction`` (4)–(6), ``ball_ramp`` (7)–(9), ``belleville`` (10), ``pack`` Fig. 6b,
``driveline`` Fig. 7, ``friction`` Fig. 8 and its alternatives, ``controller``, ``thermal``.

``full`` puts all of them together for simulation; what stands here is the ``reduced`` model that
the estimator runs on.
"""

from __future__ import annotations

from collections.abc import Container, Mapping

from clutchest.models.alsd import driveline
from clutchest.models.alsd.parameters import PARAMETERS
from clutchest.models.alsd.reduced import PIECES, slip_measured
from clutchest.models.error_terms import ErrorTerm
from clutchest.models.model import Model
from clutchest.models.symbols import Input, Sensor, State

STATES = (
    State(
        "current",
        "A",
        "i_a",
        "armature current",
        1.0,
        2.0,
        1.0,
        "any sample of the armature current",
        carried=False,
        stiff=True,
    ),
    State(
        "motor_speed",
        "rad/s",
        "ω_m1",
        "actuator motor's speed",
        100.0,
        5.0,
        20.0,
        "any two samples of the motor angle",
        carried=False,
        stiff=True,
    ),
    State(
        "motor_angle",
        "rad",
        "α_m1",
        "actuator motor's angle, 0 at home",
        0.03,
        0.5,
        0.05,
        "any sample of the motor angle",
        carried=False,
    ),
    State(
        "ball_ramp_bristle",
        "rad",
        "z_br",
        "bristle of the ball ramp's friction",
        0.01,
        1e-3,
        0.02,
        "a motor that turns under load",
        carried=False,
        stiff=True,
    ),
    State(
        "pack_force",
        "N",
        "F_c",
        "axial force of the clutch pack",
        300.0,
        10.0,
        1000.0,
        "an engagement",
        carried=False,
        stiff=True,
    ),
    State(
        "wind_up",
        "rad",
        "z",
        "differential's play and clutch bristle",
        1e-4,
        4e-3,
        2e-3,
        "an engagement with slip",
        carried=False,
    ),
    State(
        "free_play",
        "m",
        "x_fp",
        "free play of the pack; wear widens it",
        4e-7,
        5e-5,
        5e-6,
        "an engagement",
        slip_noise=1e-10,
        healthy_std=1e-5,
        prior="free_play",
    ),
    State(
        "friction",
        "1",
        "μ/μ_0",
        "friction relative to its nominal coefficient",
        5e-4,
        0.15,
        0.05,
        "an engagement with slip",
        healthy_std=0.03,
        factor=True,
        prior="friction_coefficient",
    ),
    State(
        "temp_pack",
        "°C",
        "ϑ_p",
        "clutch pack",
        0.02,
        10.0,
        10.0,
        "the oil temperature, while the clutch rests",
        0.15,
    ),
    State(
        "temp_armature",
        "°C",
        "ϑ_a",
        "armature of the actuator's motor",
        0.05,
        10.0,
        10.0,
        "current at a held motor",
        0.15,
    ),
)

# Pairs of states that one kind of measurement knows together, and the manoeuvre that parts them.
APART = (
    (("friction", "pack_force"), "engagements at several currents"),
    (("free_play", "motor_angle"), "the motor at home"),
)

INPUTS = (
    Input("armature_voltage", "V", "u_a", "armature voltage"),
    Input("slip_speed", "rad/s", "ω_s", "slip of the clutch"),
    Input("oil_temp", "°C", "ϑ_oil", "oil in the differential", default=60.0, gap=60.0),
)
_WHEELS = (
    Input("wheel_speed_left", "rad/s", "ω_l", "wheel behind the clutch"),
    Input("wheel_speed_right", "rad/s", "ω_r", "the other wheel of the axle"),
)

COLUMNS = (
    ("armature_voltage", "V"),
    ("armature_current", "A"),
    ("motor_angle", "rad"),
    ("slip_speed", "rad/s"),
    ("oil_temp", "°C"),
    ("armature_temp", "°C"),
    ("clutch_torque", "Nm"),
    ("motor_torque", "Nm"),
    ("drive_torque", "Nm"),
    ("shaft_torque", "Nm"),
    ("drive_angle", "rad"),
    ("wheel_speed_left", "rad/s"),
    ("wheel_speed_right", "rad/s"),
)

SENSORS = (
    Sensor("armature_current", "A", "i_a", "armature current"),
    Sensor("motor_angle", "rad", "α_m1", "actuator motor's angle"),
    Sensor("armature_temp", "°C", "ϑ_a", "armature temperature"),
    Sensor("clutch_torque", "Nm", "T_c", "torque at the grounded output shaft", mode="slipping"),
    Sensor("shaft_torque", "Nm", "T_c", "left half-shaft less right", mode="slipping"),
)


# Bristles, servo and controllers stand in the full model alone.
_ELSEWHERE = {
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
    parameters=tuple(p for p in PARAMETERS if p.key not in _ELSEWHERE),
    inputs=INPUTS,
    regime=(),
    sensors=SENSORS,
    outputs=("friction_potential", "transmitted_torque", "power"),
    pieces=PIECES,
    anchor="motor_angle",
    longest=(1e-3, 1e-3),
    hottest="temp_pack",
    doubted=("free_play",),
)

_NO_SLIP = "no slip speed and no wheel speeds, so that torque and its heat are unknown"
_NO_TORQUE = "no torque signal: the actuator alone tells the force, not the friction"


def for_signals(names: Container[str]) -> Model:
    """The model that the signals at hand can drive."""
    model = ALSD
    if "slip_speed" not in names and "wheel_speed_left" in names:
        from dataclasses import replace

        inputs = (INPUTS[0], *_WHEELS, INPUTS[2])
        model = replace(model.swap(slip_measured, driveline.car), inputs=inputs)
    if "clutch_torque" not in names and "shaft_torque" not in names:
        model = model.unobserved({"friction": _NO_TORQUE})
    return model


def resting(parameters: Mapping[str, float], inputs: Mapping[str, float]) -> dict[str, float]:
    """State at the start of a drive: the actuator at home, everything as warm as the oil."""
    oil = inputs["oil_temp"]
    return {
        "free_play": parameters["free_play"],
        "friction": 1.0,
        "temp_pack": oil,
        "temp_armature": oil,
    }


# Where the equations may be wrong in a way that no effect knows.
ERROR_TERMS: Mapping[str, ErrorTerm] = {
    "torque": ErrorTerm("torque", {"friction_now": lambda value, g: value * (1 + 0.1 * g)}),
    "current": ErrorTerm("current", {"motor_voltage": lambda value, g: value - 0.2 * g}),  # V
    "motor": ErrorTerm(
        "motor", {"motor_friction_torque": lambda value, g: value + 0.005 * g}
    ),  # Nm
    "axial_force": ErrorTerm(
        "axial_force", {"ball_ramp_torque": lambda value, g: value * (1 + 0.05 * g)}
    ),
    "pack_heat": ErrorTerm("pack_heat", {"pack_heat": lambda value, g: value + 200.0 * g}),  # W
    "sensor:motor_angle": ErrorTerm(
        "sensor:motor_angle", {"motor_angle_reading": lambda value, g: value + 0.1 * g}
    ),  # rad
    "sensor:armature_current": ErrorTerm(
        "sensor:armature_current",
        {"armature_current_reading": lambda value, g: value * (1 + 0.05 * g)},
    ),
    "timing:armature_voltage": ErrorTerm(
        "timing:armature_voltage", late=("armature_voltage", 0.005)
    ),
    "timing:slip_speed": ErrorTerm("timing:slip_speed", late=("slip_speed", 0.005)),
}
TOLD_APART_BY = (
    (("torque", "axial_force"), "a force sensor in the clutch pack"),
    (("motor", "axial_force"), "a torque sensor on the actuator's motor"),
)
TOLD_BY = {"": "a torque sensor on the half-shaft"}
DRIVERS = ("slip_speed", "motor_torque")
RATES = {"voltage_rate": "armature_voltage"}
PEAKS = {"temp_pack_peak": "temp_pack"}
