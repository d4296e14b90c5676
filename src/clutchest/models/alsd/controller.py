"""Controllers of the rig, as pieces of the model.

Both are PI controllers with a limit; the integrator is reduced by as much as the limit takes away
(back-calculation), so that it does not wind up.
"""

from __future__ import annotations

from clutchest.casadi_later import ca
from clutchest.models.model import Quantities

ANGLE_GAIN, ANGLE_RATE = 2.0, 0.05  # A/rad and A s/rad
LARGEST_CURRENT = 20.0  # A


def _limited(value: ca.SX, limit: ca.SX | float) -> ca.SX:
    return ca.fmin(ca.fmax(value, -limit), limit)


def current_controller(q: Quantities) -> None:
    """Armature voltage from the requested current i_aR, within the supply's ±12 V."""
    error = q.current_request - q.current
    wanted = q.current_proportional * error + q.current_integrator
    q.armature_voltage = _limited(wanted, q.supply_voltage)
    excess = (q.armature_voltage - wanted) / q.current_proportional
    q.current_integrator_rate = q.current_integral * (error + excess)


def angle_controller(q: Quantities) -> None:
    """Requested current from a requested motor angle: experiment I6."""
    lag = q.angle_request - q.motor_angle
    q.current_request = _limited(ANGLE_GAIN * lag - ANGLE_RATE * q.motor_speed, LARGEST_CURRENT)


def slip_controller(q: Quantities) -> None:
    """Servo torque T_m2 from the requested slip speed."""
    error = q.final_drive_ratio * q.slip_request - q.drive_speed
    wanted = q.servo_proportional * error + q.servo_integrator
    q.drive_torque = _limited(wanted, q.servo_torque_limit)
    excess = (q.drive_torque - wanted) / q.servo_proportional
    q.servo_integrator_rate = q.servo_integral * (error + excess)
