"""What the differential's estimator is made of: states, inputs, sensors and canonical columns."""

from __future__ import annotations

from clutchest.models.declarations import Separation
from clutchest.models.symbols import Column, Input, Sensor, State

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

COLUMNS = (
    Column("armature_voltage", "V", rests=True),
    Column("armature_current", "A", rests=True),
    Column("motor_angle", "rad"),
    Column("slip_speed", "rad/s", rests=True),
    Column("oil_temp", "°C", possible=(-50.0, 180.0, 5.0)),
    Column("armature_temp", "°C", possible=(-50.0, 250.0, 20.0)),
    Column("clutch_torque", "Nm"),
    Column("motor_torque", "Nm"),
    Column("drive_torque", "Nm"),
    Column("shaft_torque", "Nm"),
    Column("drive_angle", "rad"),
    Column("wheel_speed_left", "rad/s", rests=True),
    Column("wheel_speed_right", "rad/s", rests=True),
)

SENSORS = (
    Sensor("armature_current", "A", "i_a", "armature current"),
    Sensor("motor_angle", "rad", "α_m1", "actuator motor's angle"),
    Sensor("armature_temp", "°C", "ϑ_a", "armature temperature"),
    Sensor("clutch_torque", "Nm", "T_c", "torque at the grounded output shaft", mode="slipping"),
    Sensor("shaft_torque", "Nm", "T_c", "left half-shaft less right", mode="slipping"),
)
