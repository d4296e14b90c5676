"""The whole actuator and clutch of [ID08], bristles, gaps and controllers included.

For simulation.  The estimator runs on the reduced model of ``clutchest.models.alsd``.
"""

from __future__ import annotations

from dataclasses import replace

from clutchest.models.alsd import (
    ball_ramp,
    belleville,
    controller,
    dc_motor,
    driveline,
    motor_friction,
    pack,
    thermal,
)
from clutchest.models.alsd.friction import reset_integrator
from clutchest.models.alsd.parameters import PARAMETERS
from clutchest.models.model import Model
from clutchest.models.symbols import Input, State


def _state(name: str, unit: str, symbol: str, what: str, stiff: bool = False) -> State:
    return State(name, unit, symbol, what, 0.0, 0.0, 0.0, stiff=stiff)


_ACTUATOR = (
    _state("current", "A", "i_a", "armature current", stiff=True),
    _state("motor_speed", "rad/s", "ω_m1", "motor speed"),
    _state("motor_angle", "rad", "α_m1", "motor angle, 0 at home"),
    _state("motor_bristle", "rad", "z", "bristle of the motor's friction", stiff=True),
    _state("ball_ramp_bristle", "rad", "z_br", "bristle of the ball ramp", stiff=True),
    _state("plate_position", "m", "d_pp", "press plate, 0 at rest", stiff=True),
    _state("wind_up", "rad", "z", "differential play and clutch bristle", stiff=True),
    _state("free_play", "m", "x_fp", "free play of the pack"),
    _state("friction", "1", "μ/μ_0", "friction relative to its nominal coefficient"),
    _state("temp_pack", "°C", "ϑ_p", "clutch pack"),
    _state("temp_armature", "°C", "ϑ_a", "armature"),
)
_CONTROLLED = (_state("current_integrator", "V", "u_I", "integrator of the current controller"),)
_SERVO = (
    _state("drive_speed", "rad/s", "ω_m2", "servo motor speed", stiff=True),
    _state("drive_angle", "rad", "α_m2", "servo motor angle"),
    _state("servo_integrator", "Nm", "T_I", "integrator of the slip speed controller"),
)
_CASE = (
    _state("case_speed", "rad/s", "ω_2'", "differential case"),
    _state("case_angle", "rad", "α_2'", "differential case"),
)

_OIL = Input("oil_temp", "°C", "ϑ_oil", "oil in the differential")
_REQUEST = Input("current_request", "A", "i_aR", "requested armature current")
_SLIP_REQUEST = Input("slip_request", "rad/s", "ω_sR", "requested slip speed")
_DRIVE_TORQUE = Input("drive_torque", "Nm", "T_m2", "torque of the servo motor")
_WHEELS = (
    Input("wheel_speed_left", "rad/s", "ω_l", "wheel behind the clutch"),
    Input("wheel_speed_right", "rad/s", "ω_r", "the other wheel of the axle"),
)

RIG = Model(
    name="alsd",
    states=(*_ACTUATOR, *_CONTROLLED, *_SERVO),
    parameters=PARAMETERS,
    inputs=(_REQUEST, _SLIP_REQUEST, _OIL),
    sensors=(),
    outputs=("clutch_torque", "power"),
    pieces=(
        controller.current_controller,
        dc_motor.armature,
        dc_motor.motor_torque,
        belleville.reset_spring,
        ball_ramp.gear,
        ball_ramp.coulomb_level,
        ball_ramp.dahl,
        motor_friction.lugre,
        dc_motor.rotor,
        ball_ramp.limiter,
        pack.pack,
        pack.plate,
        pack.potential,
        controller.slip_controller,
        driveline.rig_lumped,
        driveline.wound_up,
        reset_integrator,
        thermal.clutch_torque,
        driveline.servo_lumped,
        thermal.temperatures,
    ),
)

# The structure's own compliance and inertia stand apart: stiffer, for laws without a bristle.
RIG_APART = replace(
    RIG.swap(driveline.rig_lumped, driveline.rig_apart).swap(
        driveline.servo_lumped, driveline.servo_apart
    ),
    states=(*RIG.states, *_CASE),
)

# On the road the wheels set the slip, whatever torque that takes.
CAR = replace(
    RIG.without(controller.slip_controller, driveline.servo_lumped).swap(
        driveline.rig_lumped, driveline.car
    ),
    states=(*_ACTUATOR, *_CONTROLLED),
    inputs=(_REQUEST, *_WHEELS, _OIL),
)


def bare_on_angle(model: Model) -> Model:
    """The same rig with its pack removed and the motor's angle controlled: experiment I6."""
    pieces = (controller.angle_controller, *model.swap(pack.pack, pack.no_pack).pieces)
    angle = Input("angle_request", "rad", "α_R", "requested motor angle")
    inputs = tuple(angle if i.name == "current_request" else i for i in model.inputs)
    return replace(model, pieces=pieces, inputs=inputs)


def on_drive_torque(model: Model) -> Model:
    """The same rig with the servo torque given, without the slip speed controller."""
    return replace(
        model.without(controller.slip_controller),
        states=tuple(s for s in model.states if s.name != "servo_integrator"),
        inputs=tuple(_DRIVE_TORQUE if i.name == "slip_request" else i for i in model.inputs),
    )


def rest(model: Model, free_play: float, temperature: float) -> dict[str, float]:
    """State values of an actuator at home in a differential of one temperature."""
    values = dict.fromkeys((state.name for state in model.states), 0.0)
    return values | {
        "free_play": free_play,
        "friction": 1.0,
        "temp_pack": temperature,
        "temp_armature": temperature,
    }
