"""Others' friction model M6 of the same bench, run by us on the same runs.

The model is Duclusaud's and Passault's (BAM): load-dependent, directional, with Stribeck and
quadratic terms; its numbers are those that the bench's authors fitted.
"""

from __future__ import annotations

import numpy as np

STEP = 0.005  # s
GRAVITY = 9.80665  # m/s²

# As the bench's authors state them for their cleaned data.
M6 = {
    "torque_constant": 3.5555,
    "resistance": 7.1214,
    "armature": 0.0283,
    "offset": -0.0140,
    "base": 0.00006,
    "stribeck": 0.0840,
    "motor": 0.2892,
    "external": 0.00002,
    "motor_slow": 0.2985,
    "external_slow": 0.00004,
    "motor_squared": 0.0089,
    "external_squared": 0.0021,
    "stribeck_speed": 0.0748,
    "exponent": 1.2952,
    "viscous": 0.0762,
}


def friction(motor: np.ndarray, gravity: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """The most that friction can brake (runs), Nm, under torques of motor and gravity."""
    p = M6
    slow = np.exp(-(np.abs(speed / p["stribeck_speed"]) ** p["exponent"]))
    load = np.abs(gravity * p["external"] - motor * p["motor"])
    load_slow = np.abs(gravity * p["external_slow"] - motor * p["motor_slow"])
    squared = np.where(
        np.abs(gravity) < np.abs(motor),
        p["external_squared"] * gravity**2,
        p["motor_squared"] * motor**2,
    )
    opposed = np.sign(gravity) != np.sign(motor)
    most = p["base"] + load + slow * (p["stribeck"] + load_slow + squared * opposed)
    return most + p["viscous"] * np.abs(speed)


def acceleration(
    position: np.ndarray, speed: np.ndarray, voltage: np.ndarray, on: np.ndarray, runs: dict
) -> np.ndarray:
    """dω/dt over the next step (runs); friction stops the arm at most."""
    p = M6
    motor = p["torque_constant"] * (voltage - p["torque_constant"] * speed) / p["resistance"] * on
    gravity = -runs["mass"] * GRAVITY * runs["arm"] * np.sin(position + p["offset"])
    inertia = p["armature"] + runs["mass"] * runs["arm"] ** 2
    stop = inertia / STEP * speed + motor + gravity
    brake = np.minimum(np.abs(stop), friction(motor, gravity, speed))
    return (motor + gravity - np.sign(stop) * brake) / inertia
