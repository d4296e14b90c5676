"""The differential turned round: armature current and motor angle for a requested torque.

The reduced actuator under a position control without delay, which knows what loads the motor: the
current that it takes is the feedforward.  The loop of the ball ramp's friction, the way through the
free play against the squeeze film, and the supply's voltage come with the equations.
"""

from __future__ import annotations

from dataclasses import replace

from clutchest.casadi_later import ca
from clutchest.models.alsd import ball_ramp, belleville, dc_motor, motor_friction
from clutchest.models.alsd.parameters import PARAMETERS
from clutchest.models.alsd.reduced import axial
from clutchest.models.alsd.symbols import INPUTS, STATES
from clutchest.models.declarations import Inverse
from clutchest.models.model import Model, Quantities
from clutchest.models.symbols import Input, State

PRESSED = 1.0  # Nm of request: below, the clutch is to be open and the motor at home
GAIN = 150.0  # 1/s, of the motor's speed on its way over the angle that is left
BRAKING = 6000.0  # rad/s², with which the way is planned to end; 12 V brake with three times that
SPEED_LAG = 2e-3  # s
CURRENT_LAG = 1e-3  # s
_NAMES = (
    "current",
    "motor_speed",
    "motor_angle",
    "ball_ramp_bristle",
    "pack_force",
    "free_play",
    "friction",
    "temp_pack",
    "temp_armature",
)
SLIP = 1.0  # rad/s, unless the request states it: a clutch that slides


def potential(q: Quantities) -> None:
    """T_C = μ N_f r_e F_c, what sliding surfaces transmit."""
    q.friction_now = q.friction_coefficient * q.friction
    q.lever = q.friction_now * q.friction_surfaces * q.equivalent_radius
    q.friction_potential = q.lever * q.pack_force


def target(q: Quantities) -> None:
    """The angle at rest for the requested torque: play, free play, pack and ball ramp in series."""
    pressed = ca.fabs(q.torque_request) > PRESSED
    force = ca.fabs(q.torque_request) / q.lever
    plate = q.free_play + force / q.pack_stiffness
    spring = belleville.force(q, q.spring_preload + plate)
    twist = (force + spring) / (q.ball_ramp_ratio * q.ball_ramp_stiffness)
    angle = q.gear_backlash + q.ball_ramp_ratio * plate + twist
    q.target_angle = ca.if_else(pressed, q.gear_ratio * angle, 0.0)
    softness = q.ball_ramp_ratio / q.pack_stiffness
    softness += 1 / (q.ball_ramp_ratio * q.ball_ramp_stiffness)  # rad/N, without the spring
    rate = ca.sign(q.torque_request) * q.torque_request_rate / q.lever
    q.target_speed = ca.if_else(pressed, q.gear_ratio * softness * rate, 0.0)


def governor(q: Quantities) -> None:
    """Voltage for the current that turns the motor to its target as fast as it can stop there.

    The speed is √(2 · BRAKING · angle left) far from it and GAIN · angle left near it.  Friction of
    the bearings is that of the present speed: a motor that rests is held in the middle of the
    currents between which it sticks.
    """
    left = q.target_angle - q.motor_angle
    far = ca.sqrt(1 + GAIN**2 * ca.fabs(left) / (2 * BRAKING))
    wanted_speed = q.target_speed + GAIN * left / far
    acceleration = (wanted_speed - q.motor_speed) / SPEED_LAG
    load = q.contact * q.ball_ramp_friction_torque + q.ball_ramp_torque + q.home_torque
    torque = q.motor_inertia * acceleration + q.motor_friction_torque + load / q.gear_ratio
    q.wanted_current = torque / q.torque_factor
    change = q.inductance * (q.wanted_current - q.current) / CURRENT_LAG
    voltage = q.resistance * q.current + q.back_emf_constant * q.motor_speed + change
    q.armature_voltage = ca.fmin(ca.fmax(voltage, -q.supply_voltage), q.supply_voltage)


def requested_current(q: Quantities) -> None:
    """What the PI controller of the armature current is to be asked for, so that it gives u_a."""
    error = (q.armature_voltage - q.current_integrator) / q.current_proportional
    q.current_integrator_rate = q.current_integral * error
    q.current_request = q.current + error


def warming(q: Quantities) -> None:
    """C_a dϑ_a/dt = R_a i_a² − G_a (ϑ_a − ϑ_oil); free play, friction and pack stay as they are."""
    loss = q.resistance * q.current**2
    cooling = q.armature_conductance * (q.temp_armature - q.oil_temp)
    q.temp_armature_rate = (loss - cooling) / q.armature_heat_capacity


MODEL = Model(
    name="alsd",
    states=(
        *(state for state in STATES if state.name in _NAMES),
        State("current_integrator", "V", "u_I", "integrator of the current controller", 0, 0, 0),
    ),
    parameters=PARAMETERS,
    inputs=(
        Input("torque_request", "Nm", "T_R", "requested torque of the clutch"),
        Input("torque_request_rate", "Nm/s", "dT_R/dt", "its slope"),
        *(replace(item, default=SLIP) for item in INPUTS if item.name == "slip_speed"),
        *(item for item in INPUTS if item.name == "oil_temp"),
    ),
    sensors=(),
    outputs=(),
    pieces=(
        dc_motor.warmth,
        axial,
        ball_ramp.coulomb_level,
        ball_ramp.dahl_linear,
        motor_friction.sliding,
        potential,
        target,
        governor,
        requested_current,
        dc_motor.armature,
        dc_motor.motor_torque,
        dc_motor.rotor,
        warming,
    ),
    slopes={"torque_request_rate": "torque_request"},
    doubted=("free_play",),
)

INVERSE = Inverse(
    model=MODEL,
    request="torque_request",
    reached="friction_potential",
    columns={
        "current": "A",
        "motor_angle": "rad",
        "motor_speed": "rad/s",
        "current_request": "A",
        "friction_potential": "Nm",
    },
    step=1e-4,
)
