"""The reported engine torque is wrong in proportion."""

from __future__ import annotations

from clutchest.models.dry_clutch.effects.torque_gain import TorqueGain
from clutchest.models.fault import ModelFault

FAULT = ModelFault("torque_gain", TorqueGain(), "change", size=0.05, fmi=(0, 1))
