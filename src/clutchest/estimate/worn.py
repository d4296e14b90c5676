"""Parts that are worn: how far a state may be from new, and a vehicle with what a drive found."""

from __future__ import annotations

import numpy as np

from clutchest.estimate.run import Track
from clutchest.vehicle import Vehicle

FAR = 4.0  # standard deviations of a new part, from which on it is worn
BEYOND = 1.5  # limits of wear, up to which a part may be worn


def worn_range(vehicle: Vehicle) -> tuple[str, float, float] | None:
    """The state that wears, and between which values a worn part has it, in its unit; None of a
    machine without wear, or a vehicle without a limit of it."""
    wear, limit = vehicle.machine.wear, vehicle.limits.get("wear")
    if wear is None or limit is None:
        return None
    new = vehicle.parameters[wear.nominal]
    ends = (FAR * new.spread, BEYOND * limit.value + FAR * new.spread)
    low, high = sorted(new.value + wear.sign * end for end in ends)
    return wear.state, low, high


def worn_so_far(track: Track, worn: tuple[str, float, float] | None) -> bool:
    """Whether the state of a drive ended where that of a ``worn`` part lies."""
    if worn is None or not len(track.time) or worn[0] not in track.states:
        return False
    value = float(track.states[worn[0]].value[-1])
    return bool(np.isfinite(value)) and worn[1] < value < worn[2]


def as_found(vehicle: Vehicle, track: Track) -> Vehicle | None:
    """The vehicle with the wear that a drive found as the start of its state; None where it is as
    good as new, and where the nominal value is of other use, too.

    Equations are linearised about the start.  From that of a new part, ten standard deviations
    off, a worn one would be estimated with as large an error.
    """
    wear = vehicle.machine.wear
    if wear is None or wear.nominal != wear.state or not worn_so_far(track, worn_range(vehicle)):
        return None
    return vehicle.with_parameters(**{wear.nominal: float(track.states[wear.state].value[-1])})
