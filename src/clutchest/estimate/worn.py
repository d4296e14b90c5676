"""Parts that are worn: how far a state may be from new, and a vehicle with what a drive found."""

from __future__ import annotations

import numpy as np

from clutchest.estimate.run import Track
from clutchest.models.declarations import Wear
from clutchest.vehicle import Vehicle

FAR = 4.0  # standard deviations of a new part, from which on it is worn
BEYOND = 1.5  # limits of wear, up to which a part may be worn


def worn_range(vehicle: Vehicle) -> tuple[str, float, float] | None:
    """The state that wears, and between which values a worn part has it, in its unit: up to beyond
    the limit that the vehicle file states, else the largest plausible wear; None of a machine that
    declares neither."""
    wear = vehicle.machine.wear
    most = None if wear is None else _most(vehicle, wear)
    if wear is None or most is None:
        return None
    new = vehicle.parameters[wear.nominal]
    ends = (FAR * new.spread, BEYOND * most + FAR * new.spread)
    low, high = sorted(new.value + wear.sign * end for end in ends)
    return wear.state, low, high


def _most(vehicle: Vehicle, wear: Wear) -> float | None:
    if (limit := vehicle.limits.get("wear")) is not None:
        return limit.value
    effect = vehicle.machine.effects.get(wear.effect)
    gains = () if effect is None else effect.gains
    return next((gain.upper for gain in gains if gain.key == wear.amount), None)


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
