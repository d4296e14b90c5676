"""The pack transmits less or more torque in proportion: wrong oil, glazed plates."""

from __future__ import annotations

from clutchest.models.alsd.effects.friction_level import FrictionLevel
from clutchest.models.fault import ModelFault

FAULT = ModelFault("friction_level", FrictionLevel(), "change", size=0.25, fmi=(16, 18))
