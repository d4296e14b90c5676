"""The reduced model of the estimator: what is fast or stiff is replaced by its limit.

====================  ==========================================================================
motor friction        LuGre's bristle always bent all the way: (5) with (6), no pre-sliding
ball-ramp friction    as in the full model with i = 1: its bristle bends over radians of the
                      motor
press plate           quasi-static in the free play, where the squeeze film loads the motor; in
                      the pack the force relaxes with the plate's own time constant; the point of
                      contact is as uncertain as the filter's free play (``free_play_std``)
reset spring          at the plate position that the pack's force implies
friction potential    begins flat, within some hundred newtons of touching
driveline             the slip speed is measured; play and bristle wind up with it
====================  ==========================================================================
"""

from __future__ import annotations

from clutchest.casadi_later import ca
from clutchest.models.alsd import (
    ball_ramp,
    belleville,
    dc_motor,
    driveline,
    motor_friction,
    thermal,
)
from clutchest.models.alsd.friction import reset_integrator
from clutchest.models.model import Quantities

FIRST_CONTACT = 300.0  # N, F_1
SHARP = 1.0  # N, width of a kink at a known place


def axial(q: Quantities) -> None:
    """T_1 and dF_c/dt: gear play, limiter, free play and pack, one after the other.

    The pack takes F = κ (c_1 K_br (φ − α_b1 − K_br x_fp) − F_rs) at rest, with
    κ = c_cl.e/(c_1 K_br² + c_cl.e), and reaches it within d_e/(c_1 K_br² + c_cl.e).
    """
    ramp, stiffness = q.ball_ramp_ratio, q.ball_ramp_stiffness
    q.input_angle = q.motor_angle / q.gear_ratio
    angle = q.input_angle - q.gear_backlash  # behind the play
    q.contact = angle > 0  # f(α)
    q.gap = ca.fmax(q.free_play - ca.fmax(angle, 0.0) / ramp, 0.0)
    plate = q.free_play + q.pack_force / q.pack_stiffness
    q.spring_force = belleville.force(q, q.spring_preload + plate)
    together = stiffness * ramp**2 + q.pack_stiffness
    share = q.pack_stiffness / together
    reached = share * (stiffness * ramp * (angle - ramp * q.free_play) - q.spring_force)
    touching, expected = either_side(reached, share * stiffness * ramp**2 * q.free_play_std)
    q.pack_force_rate = (expected - q.pack_force) * together / q.axial_damping

    film = q.axial_damping * q.motor_speed / (q.gear_ratio * ramp)
    lifted = ca.fmax(q.spring_force + film, 0.0) / ramp  # the plate on its way to the pack
    resting = stiffness * ca.fmax(angle, 0.0)  # the plate on its limiter
    squeezed = q.axial_damping * q.pack_force_rate / q.pack_stiffness
    pressing = (q.pack_force + touching * q.spring_force + squeezed) / ramp  # against the pack
    q.ball_ramp_torque = (1 - touching) * ca.fmin(resting, lifted) + pressing
    q.ball_ramp_force = ramp * q.ball_ramp_torque
    q.home_torque = -stiffness * ca.fmax(-q.input_angle - q.gear_backlash, 0.0)


def either_side(value: ca.SX, std: ca.SX) -> tuple[ca.SX, ca.SX]:
    """The probability that a normal quantity, ``value`` ± ``std``, is above 0, and the mean of its
    positive part.  A filter linearised at ``value`` alone would take one side of the kink for
    certain, and every step without contact for information about the free play.

    Φ of the normal distribution by tanh instead of the error function, within 0.0004.
    """
    std = std + SHARP
    z = ca.fmin(ca.fmax(value / std, -20.0), 20.0)
    above = (1 + ca.tanh(ca.sqrt(2 / ca.pi) * (z + 0.044715 * z**3))) / 2
    return above, value * above + std * ca.exp(-(z**2) / 2) / ca.sqrt(2 * ca.pi)


def pressed_potential(q: Quantities) -> None:
    """T_C = μ N_f r_e F_c⁵/(F_c⁴ + F_1⁴): below F_1 surfaces hardly touch.

    At first contact, whether they slide already depends on the last micrometre of free play; a
    slope that begins at 0 keeps the filter from knowing it too soon.  Torque that is still missing
    at a higher force would bias the free play.
    """
    q.friction_now = q.friction_coefficient * q.friction
    touching = q.pack_force**5 / (q.pack_force**4 + FIRST_CONTACT**4)
    q.friction_potential = q.friction_now * q.friction_surfaces * q.equivalent_radius * touching


def slip_measured(q: Quantities) -> None:
    """The rig measures ω_s; the structure's compliance lies within the bristle."""
    q.bristle_stiffness = q.torsional_stiffness
    q.bristle_play = q.differential_backlash


def readings(q: Quantities) -> None:
    """What the sensors show."""
    q.armature_current_reading = q.current
    q.motor_angle_reading = q.motor_angle
    q.armature_temp_reading = q.temp_armature
    q.clutch_torque_reading = q.clutch_torque
    q.shaft_torque_reading = q.clutch_torque
    q.transmitted_torque = q.clutch_torque


def wear(q: Quantities) -> None:
    """Free play is constant, unless an effect lets slip wear the pack."""
    q.free_play_rate = 0.0


PIECES = (
    dc_motor.armature,
    dc_motor.motor_torque,
    axial,
    ball_ramp.coulomb_level,
    ball_ramp.dahl_linear,
    motor_friction.sliding,
    dc_motor.rotor,
    slip_measured,
    pressed_potential,
    driveline.wound_up,
    reset_integrator,
    thermal.clutch_torque,
    thermal.temperatures,
    wear,
    readings,
)
