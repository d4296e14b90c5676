"""What the differential's estimator is made of: states, inputs, sensors and canonical columns."""

from __future__ import annotations

from clutchest.models.declarations import Separation
from clutchest.models.symbols import Column, Input, Sensor, State

METAL = (-60.0, 1150.0)  # °C, from the coldest night to where steel plates melt
WINDING = (-60.0, 400.0)  # °C, beyond the insulation of any motor

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
        factor=True,
        prior="friction_coefficient",
        possible=(0.02, 2.5),
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
        possible=METAL,
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
        possible=WINDING,
    ),
)

# Pairs of states that one kind of measurement informs together, and the manoeuvre that separates
# them.
SEPARATING_MANOEUVRES = (
    Separation(("friction", "pack_force"), "engagements at several currents"),
    Separation(("free_play", "motor_angle"), "the motor at home"),
)

INPUTS = (
    Input("armature_voltage", "V", "u_a", "armature voltage"),
    Input("slip_speed", "rad/s", "ω_s", "slip of the clutch"),
    Input("oil_temp", "°C", "ϑ_oil", "oil in the differential", default=60.0, gap=60.0),
)
WHEELS = (
    Input("wheel_speed_left", "rad/s", "ω_l", "wheel behind the clutch"),
    Input("wheel_speed_right", "rad/s", "ω_r", "the other wheel of the axle"),
)

# How a bus or a table may name them; the paper's own symbols, too.
_ARMATURE, _MOTOR = r"(arm(ature)?|anker|mot(or)?|act(uator)?)", r"(mot(or)?|rotor|act(uator)?)"
_TORQUE = r"(torque|trq|tq|(dreh)?moment|(?<![a-z])m(?![a-z]))"
_ANGLE = r"(ang(le)?|pos(ition)?|phi|alpha|winkel)"
_DRIVE, _CLUTCH = r"(drive|servo|antrieb)", r"(clutch|kupplung)"
_WHEEL = r"(wheel|whl|rad)\w*(speed|spd|_n_|_w_)\w*?"


def _either(one: str, other: str) -> str:
    """A name of both, in either order: ``motor_angle``, ``phi_Motor``."""
    return f"{one}_?{other}|{other}_?{one}"


def _symbol(letter: str, motor: int) -> str:
    """The paper's symbol, one more alternative: ``alpha_m1``, ``T_m2``."""
    spelt = "(α|alpha)" if letter == "α" else letter
    return rf"|^{spelt}_?m_?{motor}$"


_OF_CAR = tuple(item.name for item in WHEELS)  # a rig has slip and a drive instead

COLUMNS = (
    Column(
        "armature_voltage",
        "V",
        rests=True,
        noisiest=2.0,
        named=_ARMATURE + r"_?(volt|spannung|u(_|$))|^u_?(a$|" + _ARMATURE + ")",
    ),
    Column(
        "armature_current",
        "A",
        rests=True,
        noisiest=5.0,
        named=_ARMATURE + r"_?(curr|strom|i(_|$))|^i_?(a$|" + _ARMATURE + ")",
    ),
    Column("motor_angle", "rad", noisiest=1.0, named=_either(_MOTOR, _ANGLE) + _symbol("α", 1)),
    Column(
        "slip_speed",
        "rad/s",
        rests=True,
        noisiest=2.0,
        named=r"slip|schlupf|delta_?(speed|n(_|$))|^n_?diff|drehzahldiff|^(ω|omega)_?s$",
        instead=_OF_CAR,
    ),
    Column(
        "oil_temp",
        "°C",
        possible=(-50.0, 180.0, 5.0),
        noisiest=10.0,
        named=r"(oil|(ö|oe)l|fluid)\w*(temp|_t$)|^t_?(oil|öl|oel)",
    ),
    Column(
        "armature_temp",
        "°C",
        possible=(-50.0, 250.0, 20.0),
        noisiest=20.0,
        named=r"(arm(ature)?|anker|winding|wicklung|coil|mot(or)?)_?\w*temp"
        r"|^t_?(arm|anker|winding|wicklung|coil|mot)|^(ϑ|theta)_?a$",
    ),
    Column(
        "clutch_torque",
        "Nm",
        noisiest=200.0,
        named=_CLUTCH + r"_?\w*" + _TORQUE + "|" + _TORQUE + "_?" + _CLUTCH + "|^t_?c$"
        r"|(?<![a-z])cl(t|u|ut|tch)?_?" + _TORQUE,
        instead=("shaft_torque",),
    ),
    Column("motor_torque", "Nm", noisiest=1.0, named=_either(_MOTOR, _TORQUE) + _symbol("t", 1)),
    Column(
        "drive_torque",
        "Nm",
        noisiest=100.0,
        named=_either(_DRIVE, _TORQUE) + _symbol("t", 2),
        instead=_OF_CAR,
    ),
    Column(
        "shaft_torque",
        "Nm",
        noisiest=300.0,
        named=r"(shaft|axle|welle)_?\w*" + _TORQUE,
        instead=("clutch_torque",),
    ),
    Column(
        "drive_angle",
        "rad",
        noisiest=0.05,
        named=_either(_DRIVE, _ANGLE) + _symbol("α", 2),
        instead=_OF_CAR,
    ),
    Column("torque_request", "Nm", named=_either(_TORQUE, r"(req|dem|set|cmd|soll)")),
    Column(
        "wheel_speed_left",
        "rad/s",
        rests=True,
        noisiest=2.0,
        named=_WHEEL + r"(l|left|li)$",
        instead=("slip_speed",),
    ),
    Column(
        "wheel_speed_right",
        "rad/s",
        rests=True,
        noisiest=2.0,
        named=_WHEEL + r"(r|right|re)$",
        instead=("slip_speed",),
    ),
)

SENSORS = (
    Sensor("armature_current", "A", "i_a", "armature current", tolerance=15.0),
    Sensor("motor_angle", "rad", "α_m1", "actuator motor's angle", tolerance=40.0),
    Sensor("armature_temp", "°C", "ϑ_a", "armature temperature", tolerance=6.0),
    Sensor(
        "clutch_torque",
        "Nm",
        "T_c",
        "torque at the grounded output shaft",
        mode="slipping",
        tolerance=40.0,
    ),
    Sensor(
        "shaft_torque", "Nm", "T_c", "left half-shaft less right", mode="slipping", tolerance=40.0
    ),
)
