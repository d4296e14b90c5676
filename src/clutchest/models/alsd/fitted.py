"""The form of the equations whose numbers are fitted to whole drives.

The full model's actuator and clutch, driven by the measured voltage and slip: nothing is smoothed
for a filter of first order, the motor sticks on its bristles, and torque is read at any time, while
the structure winds up and while the clutch is open.  Where the motor stands within its play at
home, and on which side of its static friction it stopped, no number that is the same throughout a
drive says: the motor is tracked.
"""

from __future__ import annotations

from collections.abc import Container
from dataclasses import replace

from clutchest.casadi_later import ca
from clutchest.models.alsd import (
    ball_ramp,
    belleville,
    dc_motor,
    driveline,
    motor_friction,
    pack,
    thermal,
)
from clutchest.models.alsd.estimator import ALSD, FULL_MODEL_ONLY, driven_by
from clutchest.models.alsd.friction import reset_integrator
from clutchest.models.alsd.parameters import PARAMETERS
from clutchest.models.alsd.reduced import readings, slip_measured, wear
from clutchest.models.model import Model, Quantities
from clutchest.models.symbols import State

# Process noise, state unit/√s, of what is tracked: what is between the samples of the voltage,
# while the pack is pressed and the motor turns, while it creeps, and while it runs freely.
NOISE = {
    "current": (1.0, 1.0, 1.0),
    "motor_speed": (1.2, 0.4, 1.4),
    "motor_angle": (1e-3, 1e-3, 1e-3),
    "motor_bristle": (1e-3, 4e-4, 1e-3),
}
BRISTLE = State(
    "motor_bristle",
    "rad",
    "z",
    "bristle of the motor's friction",
    NOISE["motor_bristle"][0],
    0.01,
    0.01,
    "a motor that turns",
    carried=False,
    stiff=True,
)
PLATE = State(
    "plate_position",
    "m",
    "d_pp",
    "press plate, 0 at rest",
    0.0,
    1e-6,
    1e-5,
    "the motor's angle",
    carried=False,
    stiff=True,
)
LEAST = 1e-3  # N
FAST = 2.5e-4  # s, the longest step while the motor moves
_OF_BRISTLE_AND_STOP = {"motor_bristle_stiffness", "motor_bristle_damping", "limiter_stiffness"}
_STATES = {
    state.name: replace(state, process_noise=NOISE.get(state.name, (state.process_noise,))[0])
    for state in ALSD.states
}


def touching(q: Quantities) -> None:
    """Behind its play the bristle winds up as soon as the pack presses, which it begins to within
    a step: on the force of the way of two steps, little by little.  All at once, when it began
    would seem not to matter, or, in one engagement of a hundred, a hundred times as much.
    """
    first = q.pack_stiffness * ca.fabs(q.plate_speed) * (2 * FAST) + LEAST
    winds = ca.fmin(q.pack_force / first, 1.0)
    taken_up = ca.sign(q.slip_speed) * q.wind_up >= q.bristle_play
    q.wind_up_rate = q.wind_up_rate * ca.if_else(taken_up, winds, 1.0)


PIECES = (
    dc_motor.armature,
    dc_motor.motor_torque,
    belleville.reset_spring,
    ball_ramp.gear,
    ball_ramp.coulomb_level,
    ball_ramp.dahl_linear,
    motor_friction.lugre,
    dc_motor.rotor,
    ball_ramp.limiter,
    pack.pack,
    pack.plate,
    slip_measured,
    pack.potential,
    driveline.wound_up,
    reset_integrator,
    touching,
    thermal.clutch_torque,
    thermal.temperatures,
    wear,
    readings,
)

FITTED = replace(
    ALSD,
    states=(*(PLATE if name == "pack_force" else s for name, s in _STATES.items()), BRISTLE),
    parameters=tuple(p for p in PARAMETERS if p.key not in FULL_MODEL_ONLY - _OF_BRISTLE_AND_STOP),
    sensors=tuple(replace(sensor, mode="") for sensor in ALSD.sensors),
    pieces=PIECES,
    doubted=(),
    longest=(FAST, 1e-3, 2e-3),
    at_once=(4, 1, 1),  # the estimator's step
    fast_while=("fast", "moving"),
    tracked={n: {"engaged": free, "fast": creeps} for n, (_, creeps, free) in NOISE.items()},
    uncorrected={"motor_speed": "moving", "motor_bristle": "moving"},
    exact=("armature_inductance",),  # samples come ten times as far apart as the current settles
    regime=("engaged", "moving", "fast"),
)


def to_fit(names: Container[str]) -> Model:
    """The fitted form that the available signals can drive."""
    return driven_by(FITTED, names)
