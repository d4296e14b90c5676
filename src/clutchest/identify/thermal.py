"""``thermal``: capacities and conductances of (12) and (13), from a heating and cool-down record,
by the zero position alone.

[ME12], Fig. 5: the clutch is heated by slips, then left closed while the zero position falls with
two exponentials.
"""

from __future__ import annotations

from clutchest.identify.fit import Fit
from clutchest.identify.parameter_pictures import draw_zero_position
from clutchest.identify.parameters import identify_parameters
from clutchest.progress import Progress
from clutchest.signals import Signals
from clutchest.vehicle import Vehicle

KEYS = (
    "heat_capacity_body",
    "heat_capacity_housing",
    "conductance_engine_body",
    "conductance_body_housing",
    "conductance_housing_ambient",
)


def identify(
    signals: Signals, vehicle: Vehicle, progress: Progress, holdout: Signals | None = None
) -> Fit:
    """The thermal numbers of body and housing; heat is that of the measured torque."""
    return identify_parameters(
        "thermal", KEYS, draw_zero_position, signals, vehicle, progress, holdout, "zero_position"
    )
