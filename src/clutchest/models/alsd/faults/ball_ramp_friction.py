"""More or less friction in the ball ramp."""

from __future__ import annotations

from clutchest.models.alsd.effects.ball_ramp_friction import BallRampFriction
from clutchest.models.fault import ModelFault

FAULT = ModelFault("ball_ramp_friction", BallRampFriction(), "change", size=0.5, fmi=(16, 18))
