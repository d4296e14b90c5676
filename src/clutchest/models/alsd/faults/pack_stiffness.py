"""The clutch pack is softer or harder than it was."""

from __future__ import annotations

from clutchest.models.alsd.effects.pack_stiffness import PackStiffness
from clutchest.models.fault import ModelFault

FAULT = ModelFault("pack_stiffness", PackStiffness(), "change", size=0.15, fmi=(16, 18))
