"""The current sensor's scale is off."""

from __future__ import annotations

from clutchest.models.alsd.effects.current_gain import CurrentGain
from clutchest.models.fault import ModelFault

FAULT = ModelFault("current_gain", CurrentGain(), "change", size=0.08, fmi=(0, 1))
