"""The drive of the clutch: the rig's servo motor with its final drive, or a car's wheels."""

from __future__ import annotations

from clutchest.casadi_later import ca
from clutchest.models.alsd.gap import dead_zone
from clutchest.models.model import Quantities

REVERSAL = 0.02  # rad/s, over which the driveline's friction turns its sign


def wound_up(q: Quantities) -> None:
    """z = dz(wind-up, α_b2): the bristle in series with the differential's play."""
    q.deflection = dead_zone(q.wind_up, q.bristle_play)


def rig_lumped(q: Quantities) -> None:
    """The structure's compliance within the bristle: one inertia, ω_s = ω_m2/K_g2."""
    q.slip_speed = q.drive_speed / q.final_drive_ratio
    q.bristle_play = q.differential_backlash
    q.bristle_stiffness = q.torsional_stiffness
    _friction(q)
    q.stuck = 0.0
    q.driving_torque = q.final_drive_ratio * (q.drive_torque - q.drive_friction)


def rig_apart(q: Quantities) -> None:
    """T_2 = c_2 dz(α_m2/K_g2 − α_2', α_b2): the structure's compliance and play by themselves.

    The bristle keeps the clutch's own stiffness: 1/c_c2 = 1/σ_0.c − 1/c_2.
    """
    q.slip_speed = q.case_speed
    q.bristle_play = 0.0
    q.bristle_stiffness = 1 / (1 / q.torsional_stiffness - 1 / q.structure_stiffness)
    twist = q.drive_angle / q.final_drive_ratio - q.case_angle
    q.structure_torque = q.structure_stiffness * dead_zone(twist, q.differential_backlash)
    q.driving_torque = q.structure_torque
    q.stuck = 0.0
    _friction(q)


def _friction(q: Quantities) -> None:
    """T_f2."""
    q.drive_friction = q.driveline_friction * ca.tanh(q.drive_speed / REVERSAL)


def servo_lumped(q: Quantities) -> None:
    """J_2 dω_m2/dt = T_m2 − T_f2 − T_c/K_g2."""
    q.structure_torque = q.clutch_torque
    q.drive_speed_after_step = ca.if_else(q.stuck, 0.0, q.drive_speed)
    _servo(q)


def servo_apart(q: Quantities) -> None:
    """J_2' dω_2'/dt = T_2 − T_c for the small inertia between structure and clutch."""
    q.case_speed_rate = (q.structure_torque - q.clutch_torque) / q.case_inertia
    q.case_angle_rate = q.case_speed
    q.case_speed_after_step = ca.if_else(q.stuck, 0.0, q.case_speed)
    _servo(q)


def _servo(q: Quantities) -> None:
    net = q.drive_torque - q.drive_friction - q.structure_torque / q.final_drive_ratio
    q.drive_speed_rate = net / q.structure_inertia
    q.drive_angle_rate = q.drive_speed


def car(q: Quantities) -> None:
    """Slip is half the left-right difference; the half-shafts wind up in series with the clutch.

    The clutch moves T_c/2 from one half-shaft to the other, so that half the difference of their
    twists is T_c/(2 k): 1/σ = 1/σ_0.c + 1/(2 k).
    """
    q.slip_speed = (q.wheel_speed_left - q.wheel_speed_right) / 2
    q.bristle_stiffness = 1 / (1 / q.torsional_stiffness + 0.5 / q.halfshaft_stiffness)
    q.bristle_play = q.differential_backlash
    q.driving_torque = 0.0
    q.stuck = 0.0
