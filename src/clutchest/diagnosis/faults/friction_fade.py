"""Friction is lost when the disc is hot."""

from __future__ import annotations

from clutchest.diagnosis.faults.fault import ModelFault


class FrictionFade(ModelFault):
    """Beyond a temperature of the disc, torque falls with it."""

    name = effect = "friction_fade"
    model = "dry_clutch"
    key, size = "slope", 0.1
    fmi = (18, 18)
