"""How far the motor must turn when more voltage lasts: what a stuck actuator does not do."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from clutchest.models.fault import Actuator

HOT = 150.0  # °C of the armature: least current and least torque per ampere
WORSE = 2.0  # times as much friction as the file's is no stuck actuator yet


def least_turn(parameters: Mapping[str, float], before: float, after: float) -> float:
    """The least turn of the motor, rad, after its voltage rose from ``before`` to ``after`` V.

    At rest i = u/R_a and T_m1 = K_t i.  Friction takes up 2 T_S of the motor and, after a fall of
    the load, 2ρ/(1 − ρ) of the torque that was there before, ρ = μ_b (d/2) K_br by (7); the rest
    bends at least the ball ramp's stiffness c_1.  0 where friction may take up all.
    """
    p = parameters
    warmer = HOT - p["armature_reference_temp"]
    resistance = p["armature_resistance"] * (1.0 + p["resistance_temp_coefficient"] * warmer)
    factor = p["torque_constant"] * (1.0 + p["torque_constant_temp_coefficient"] * warmer)
    low, high = (max(u, 0.0) * factor / resistance for u in (before, after))
    ratio = p["ball_ramp_friction"] * p["ball_ramp_bore"] / 2.0 * p["ball_ramp_ratio"]
    loop = 2.0 * ratio / max(1.0 - ratio, ratio)
    held = 2.0 * p["motor_static_torque"] + loop * low
    left = max(high - low - WORSE * held, 0.0)
    return float(np.square(p["gear_ratio"]) / p["ball_ramp_stiffness"] * left)


ACTUATOR = Actuator("actuator", "armature_voltage", "motor_angle", least_turn)
