"""Friction of the motor's bearings and brushes: LuGre, (4)–(6), and its sliding limit."""

from __future__ import annotations

from clutchest.casadi_later import ca
from clutchest.models.model import Quantities


def stribeck(q: Quantities) -> ca.SX:
    """(6): g(ω_m1) = T_C + (T_S − T_C) exp(−|ω_m1/ω_str|^δ)."""
    # |ω|^δ has no derivative at 0 for δ < 1, and 0^δ none that CasADi knows
    square = (q.motor_speed / q.motor_stribeck_speed) ** 2 + 1e-12
    # as an exponential, which its own derivative contains; that of ^ takes another ^
    power = ca.exp(q.motor_stribeck_exponent / 2 * ca.log(square))
    over_coulomb = q.motor_static_torque - q.motor_coulomb_torque
    return q.motor_coulomb_torque + over_coulomb * ca.exp(-power)


def lugre(q: Quantities) -> None:
    """(4), (5): dz/dt = ω_m1 − σ_0 |ω_m1| z/g(ω_m1), T_f1 = σ_0 z + σ_1 dz/dt + σ_2 ω_m1."""
    stiffness, speed = q.motor_bristle_stiffness, q.motor_speed
    q.motor_bristle_rate = speed - stiffness * ca.fabs(speed) * q.motor_bristle / stribeck(q)  # (4)
    q.motor_friction_torque = (
        stiffness * q.motor_bristle
        + q.motor_bristle_damping * q.motor_bristle_rate
        + q.motor_viscous * speed
    )  # (5)


def sliding(q: Quantities) -> None:
    """(4) at rest, z = g(ω_m1)/σ_0 · sgn ω_m1: bristles that are always bent all the way.

    The sign turns over the Stribeck speed.
    """
    direction = ca.tanh(q.motor_speed / q.motor_stribeck_speed)
    q.motor_friction_torque = stribeck(q) * direction + q.motor_viscous * q.motor_speed
