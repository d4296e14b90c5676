"""The slave sensor reads too much or too little."""

from __future__ import annotations

from clutchest.diagnosis.faults.fault import ModelFault


class PositionOffset(ModelFault):
    """The zero position and the torque's position are off alike, as wear leaves them too."""

    name = effect = "position_offset"
    model = "dry_clutch"
    key, size = "offset", 0.2
    fmi = (20, 21)
