"""Friction falls with the pack's temperature beyond an onset."""

from __future__ import annotations

from clutchest.models.alsd.effects.friction_fade import FrictionFade
from clutchest.models.fault import ModelFault

FAULT = ModelFault("friction_fade", FrictionFade(), "slope", size=0.1, fmi=(18, 18))
