"""Gearbox, ball-ramp mechanism and limiter: kinematics, compliance and friction (7)–(9).

Balls push and never pull: the compliance c_1 acts on the closing side of the gear's play only.  On
the other side the gear meets the ends of the ball grooves, its home.
"""

from __future__ import annotations

from clutchest.casadi_later import ca
from clutchest.models.model import Quantities

FLOOR = 1e-4  # Nm: a Coulomb level of 0 would leave the Dahl model without a time constant


def gear(q: Quantities) -> None:
    """T_1 = c_1 (α_m1/K_g1 − K_br d_pp − α_b1) in contact, F_br = K_br T_1, and f(α)."""
    q.input_angle = q.motor_angle / q.gear_ratio
    twist = q.input_angle - q.ball_ramp_ratio * q.plate_position - q.gear_backlash
    q.contact = twist > 0  # f(α)
    q.ball_ramp_torque = q.ball_ramp_stiffness * ca.fmax(twist, 0.0)
    q.ball_ramp_force = q.ball_ramp_ratio * q.ball_ramp_torque
    q.home_torque = -q.ball_ramp_stiffness * ca.fmax(-q.input_angle - q.gear_backlash, 0.0)


def coulomb_level(q: Quantities) -> None:
    """(7): T_C.br = μ_b (d/2) |F_br|."""
    level = q.ball_ramp_friction * q.ball_ramp_bore / 2 * ca.fabs(q.ball_ramp_force)
    q.ball_ramp_coulomb_torque = ca.fmax(level, FLOOR)


def dahl(q: Quantities) -> None:
    """(8), (9), with ω_br = f(α) ω_m1/K_g1: the bristle is frozen while the play is crossed.

    When the force falls, a bristle bent beyond the new level is reset to it.
    """
    speed = q.contact * q.motor_speed / q.gear_ratio
    stiffness, level = q.ball_ramp_bristle_stiffness, q.ball_ramp_coulomb_torque
    left = 1 - stiffness * q.ball_ramp_bristle / level * ca.sign(speed)
    power = ca.sqrt(left**2 + 1e-24) ** q.ball_ramp_exponent
    q.ball_ramp_bristle_rate = speed * power * ca.sign(left)  # (8)
    _bent(q)


def dahl_linear(q: Quantities) -> None:
    """(8), (9) with i = 1, linear in the bristle."""
    speed = q.contact * q.motor_speed / q.gear_ratio
    bent = q.ball_ramp_bristle_stiffness * q.ball_ramp_bristle / q.ball_ramp_coulomb_torque
    q.ball_ramp_bristle_rate = speed - ca.fabs(speed) * bent
    _bent(q)


def _bent(q: Quantities) -> None:
    """(9), and the reset."""
    q.ball_ramp_friction_torque = q.ball_ramp_bristle_stiffness * q.ball_ramp_bristle  # (9)
    limit = q.ball_ramp_coulomb_torque / q.ball_ramp_bristle_stiffness
    q.ball_ramp_bristle_after_step = ca.fmin(ca.fmax(q.ball_ramp_bristle, -limit), limit)


def limiter(q: Quantities) -> None:
    """A stiff stop that carries the reset spring at rest, d_pp = 0, and lifts off beyond."""
    at_rest = q.resting_spring_force
    q.limiter_force = ca.fmax(at_rest - q.limiter_stiffness * q.plate_position, 0.0)
