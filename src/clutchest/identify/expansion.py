"""``expansion``: k_exp,1 of (9) from a heating and cool-down record, by the zero position alone.

How far a given heat moves the zero position is k_exp,1 over a capacity: what the record cannot tell
apart from its thermal numbers is told by their priors.  x0_ref is a state, fitted for each drive as
in [ME12], and not written.
"""

from __future__ import annotations

from clutchest.identify.fit import Fit
from clutchest.identify.parameter_pictures import draw_zero_position
from clutchest.identify.parameters import identify_parameters
from clutchest.progress import Progress
from clutchest.signals import Signals
from clutchest.vehicle import Vehicle

KEYS = ("expansion_body",)


def identify(
    signals: Signals, vehicle: Vehicle, progress: Progress, holdout: Signals | None = None
) -> Fit:
    """The expansion of the body; heat is that of the measured torque."""
    return identify_parameters(
        "expansion", KEYS, draw_zero_position, signals, vehicle, progress, holdout, "zero_position"
    )
