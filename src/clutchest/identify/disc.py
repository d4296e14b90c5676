"""``disc``: k_exp,2, C_d and k_d2b of (14) and (15), from slips that heat the disc.

The slow numbers are known by then: they are held within the spreads that the earlier procedures
left.  What tells is how the torque at one position drifts within seconds.
"""

from __future__ import annotations

from clutchest.identify.fit import Fit
from clutchest.identify.parameter_pictures import draw_torque
from clutchest.identify.parameters import identify_parameters
from clutchest.progress import Progress
from clutchest.signals import Signals
from clutchest.vehicle import Vehicle

KEYS = ("expansion_disc", "heat_capacity_disc", "conductance_disc_body")


def identify(
    signals: Signals, vehicle: Vehicle, progress: Progress, holdout: Signals | None = None
) -> Fit:
    """The three numbers of the disc; whatever else is uncertain is estimated along."""
    return identify_parameters("disc", KEYS, draw_torque, signals, vehicle, progress, holdout)
