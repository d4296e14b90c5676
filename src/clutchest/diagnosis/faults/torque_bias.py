"""The engine's reported torque is off."""

from __future__ import annotations

from clutchest.diagnosis.faults.fault import ModelFault


class TorqueBias(ModelFault):
    """The reported torque is off by a constant."""

    name = effect = "torque_bias"
    model = "dry_clutch"
    key, size = "bias", 30.0
    fmi = (0, 1)
