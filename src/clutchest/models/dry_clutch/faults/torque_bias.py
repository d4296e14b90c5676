"""The reported engine torque has a constant error."""

from __future__ import annotations

from clutchest.models.dry_clutch.effects.torque_bias import TorqueBias
from clutchest.models.fault import ModelFault

FAULT = ModelFault("torque_bias", TorqueBias(), "bias", size=30.0, fmi=(0, 1))
