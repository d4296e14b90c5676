"""The energy balance of the differential's rig: power put in, energy stored, and heat.

A piece to be added to the full model of the rig.  Energy that the resets of the two bristles
release is heat as well; it follows from the bristles' steps, not from a rate.
"""

from __future__ import annotations

import casadi as ca

from clutchest.models.alsd import belleville
from clutchest.models.model import Quantities


def account(q: Quantities) -> None:
    """Power put in (W), energy stored (J) and heat flows (W), all of the whole rig."""
    q.electrical_power = q.armature_voltage * q.current
    q.servo_power = q.drive_torque * q.drive_speed
    q.bristle_energy = (
        q.bristle_stiffness * q.deflection**2 / 2
        + q.ball_ramp_bristle_stiffness * q.ball_ramp_bristle**2 / 2
    )
    q.stored_energy = _kinetic(q) + _elastic(q) + q.bristle_energy
    bearing = q.motor_bristle_stiffness * q.motor_bristle * q.motor_bristle_rate
    q.heat_armature = q.resistance * q.current**2
    q.heat_motor_friction = q.motor_friction_torque * q.motor_speed - bearing
    q.heat_film = q.film_damping * q.plate_speed**2
    q.heat_driveline = q.drive_friction * q.drive_speed
    # work on the two bristles that are reset: what they do not store is heat
    q.work_ball_ramp = q.contact * q.ball_ramp_friction_torque * q.motor_speed / q.gear_ratio
    q.work_clutch = q.clutch_torque * q.slip_speed


def _kinetic(q: Quantities) -> ca.SX:
    motor = q.motor_inertia * q.motor_speed**2 + q.inductance * q.current**2
    return (motor + q.structure_inertia * q.drive_speed**2) / 2


def _elastic(q: Quantities) -> ca.SX:
    lifted = q.resting_spring_force / q.limiter_stiffness - q.plate_position
    springs = (
        q.ball_ramp_torque**2 / q.ball_ramp_stiffness
        + q.home_torque**2 / q.ball_ramp_stiffness
        + q.limiter_stiffness * ca.fmax(lifted, 0.0) ** 2
        + q.pack_stiffness * q.compression**2
        + q.motor_bristle_stiffness * q.motor_bristle**2
    ) / 2
    return springs + belleville.energy(q, q.spring_preload + q.plate_position)
