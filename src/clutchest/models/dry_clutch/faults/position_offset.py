"""The slave sensor has an offset: zero position and torque curve are shifted alike, as by wear."""

from __future__ import annotations

from clutchest.models.dry_clutch.effects.position_offset import PositionOffset
from clutchest.models.fault import ModelFault

FAULT = ModelFault("position_offset", PositionOffset(), "offset", size=0.2, fmi=(20, 21))
