"""The motor's encoder has slipped on its shaft, or lost its reference: its zero is off."""

from __future__ import annotations

from clutchest.models.alsd.effects.angle_offset import AngleOffset
from clutchest.models.fault import ModelFault

FAULT = ModelFault("angle_offset", AngleOffset(), "offset", size=0.1, fmi=(0, 1))
