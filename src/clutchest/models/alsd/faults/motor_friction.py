"""More or less friction in the motor: worn brushes, a dry bearing."""

from __future__ import annotations

from clutchest.models.alsd.effects.motor_friction import MotorFriction
from clutchest.models.fault import ModelFault

FAULT = ModelFault("motor_friction", MotorFriction(), "change", size=0.5, fmi=(16, 18))
