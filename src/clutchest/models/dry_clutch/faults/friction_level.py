"""The clutch transmits less or more torque in proportion: oil on the lining, a burnt lining."""

from __future__ import annotations

from clutchest.models.dry_clutch.effects.friction_level import FrictionLevel
from clutchest.models.fault import ModelFault

FAULT = ModelFault("friction_level", FrictionLevel(), "change", size=0.1, fmi=(16, 18))
