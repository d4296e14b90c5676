"""The friction surfaces transmit less, or more."""

from __future__ import annotations

from clutchest.diagnosis.faults.fault import ModelFault


class FrictionLevel(ModelFault):
    """Oil on the lining, a burnt lining, a weak spring: torque is off in proportion."""

    name = effect = "friction_level"
    model = "dry_clutch"
    key, size = "change", 0.1
    fmi = (16, 18)
