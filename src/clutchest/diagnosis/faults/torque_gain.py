"""The engine reports too much or too little torque."""

from __future__ import annotations

from clutchest.diagnosis.faults.fault import ModelFault


class TorqueGain(ModelFault):
    """The reported torque is off in proportion."""

    name = effect = "torque_gain"
    model = "dry_clutch"
    key, size = "change", 0.05
    fmi = (0, 1)
