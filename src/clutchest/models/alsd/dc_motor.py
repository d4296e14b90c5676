"""The permanent-magnet DC motor, (1)–(3)."""

from __future__ import annotations

from clutchest.models.model import Quantities


def warmth(q: Quantities) -> None:
    """R_a, L_a and K_t at ϑ_a, linear in temperature."""
    warmer = q.temp_armature - q.armature_reference_temp
    q.resistance = q.armature_resistance * (1 + q.resistance_temp_coefficient * warmer)
    q.inductance = q.armature_inductance * (1 + q.inductance_temp_coefficient * warmer)
    q.torque_factor = q.torque_constant * (1 + q.torque_constant_temp_coefficient * warmer)


def armature(q: Quantities) -> None:
    """(1): L_a(ϑ_a) di_a/dt + R_a(ϑ_a) i_a + K_v ω_m1 = u_a."""
    q.motor_voltage = q.armature_voltage
    warmth(q)
    drop = q.resistance * q.current + q.back_emf_constant * q.motor_speed
    q.current_rate = (q.motor_voltage - drop) / q.inductance


def motor_torque(q: Quantities) -> None:
    """(2): T_m1 = K_t(ϑ_a) i_a."""
    q.motor_torque = q.torque_factor * q.current


def rotor(q: Quantities) -> None:
    """(3): J_1 dω_m1/dt = T_m1 − T_f1 − f(α) T_f.br/K_g1 − T_1/K_g1.

    At home the gear's other flank rests on the stop of the ball grooves.
    """
    load = q.contact * q.ball_ramp_friction_torque + q.ball_ramp_torque + q.home_torque
    net = q.motor_torque - q.motor_friction_torque - load / q.gear_ratio
    q.motor_speed_rate = net / q.motor_inertia
    q.motor_angle_rate = q.motor_speed
