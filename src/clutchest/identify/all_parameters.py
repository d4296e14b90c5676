"""``all``: every parameter that has a spread, by the joint likelihood of all readings."""

from __future__ import annotations

from pathlib import Path

from clutchest.identify.fit import Fit
from clutchest.identify.likelihood import Posterior
from clutchest.identify.parameter_pictures import draw_torque, draw_zero_position
from clutchest.identify.parameters import identify_parameters
from clutchest.progress import Progress
from clutchest.signals import Signals
from clutchest.vehicle import Vehicle

STATE = "zero_position_ref"  # its spread is the prior of a state


def identify(
    signals: Signals, vehicle: Vehicle, progress: Progress, holdout: Signals | None = None
) -> Fit:
    """All of them, with every drive's first states."""
    return identify_parameters("all", keys(vehicle), _draw, signals, vehicle, progress, holdout)


def keys(vehicle: Vehicle) -> list[str]:
    """Parameters with a spread."""
    return [key for key, p in vehicle.parameters.items() if p.spread > 0 and key != STATE]


def _draw(posterior: Posterior, vehicle: Vehicle, folder: Path) -> None:
    draw_torque(posterior, vehicle, folder)
    draw_zero_position(posterior, vehicle, folder)
