"""``torque-curve``: a, b and x_ISP of (5) at T_ref, from ramps of the position.

As [ME12] has it in Fig. 2 and Fig. 8: the position is ramped back and forth while the clutch slips;
corrected for the heat that this brings, all ramps lie on one curve.
"""

from __future__ import annotations

from clutchest.identify.fit import Fit
from clutchest.identify.parameter_pictures import draw_curve
from clutchest.identify.parameters import identify_parameters
from clutchest.progress import Progress
from clutchest.signals import Signals
from clutchest.vehicle import Vehicle

KEYS = ("torque_cubic", "torque_quadratic", "kiss_point")


def identify(
    signals: Signals, vehicle: Vehicle, progress: Progress, holdout: Signals | None = None
) -> Fit:
    """The three numbers of the curve; whatever else is uncertain is estimated along."""
    return identify_parameters(
        "torque-curve", KEYS, draw_curve, signals, vehicle, progress, holdout
    )
