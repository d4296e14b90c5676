"""Whether a reported torque drives what slip brakes: heat that surfaces would give back."""

from __future__ import annotations

import numpy as np

from clutchest.estimate.contradiction import Contradiction
from clutchest.estimate.timeline import regimes
from clutchest.models.regimes import average
from clutchest.signals import Signals
from clutchest.vehicle import Vehicle

SLOPE_S = 0.1  # over which the speed's slope is taken
LEAST = 0.05  # of the largest torque; a smaller one may be an error of the report
LEAST_J = 1e3  # of heat given back
TIMES = 3.0  # what is turned to heat


def against_slip(drive: Signals, vehicle: Vehicle) -> Contradiction | None:
    """That reported torque and slip have opposite signs, in all, while the clutch slips.

    The filter says so where it knows the clutch well.  Where a vehicle file is a draft, its
    parameters' spreads allow for anything, but not these signals: they need none of them but the
    inertia.
    """
    rules, way = vehicle.machine.regimes, vehicle.machine.driving
    if way is None or not set(way.signals) <= set(drive.available):
        return None
    read = drive[way.speed].only_valid()
    rising = np.diff(read.time, prepend=-np.inf) > 0.0  # a clock may give several one time
    time, speed = read.time[rising], read.value[rising]
    if len(time) < 2:
        return None
    present = {name: drive[name].only_valid() for name in drive.available}
    slipping = regimes(time, present, vehicle).mode == rules.modes.index(rules.event)
    calm = average(time, speed, SLOPE_S)
    inertia = vehicle.parameters[way.inertia].value
    torque = present[way.torque].at(time) - inertia * np.gradient(calm, time)
    slip = speed - present[way.other].at(time)
    counts = slipping & (np.abs(torque) > LEAST * vehicle.parameters[way.largest].value)
    step = np.minimum(np.diff(time, append=time[-1:]), SLOPE_S)
    energy = np.where(counts, torque * slip * step, 0.0)
    back, heat = -energy[energy < 0.0].sum(), energy[energy > 0.0].sum()
    if back < LEAST_J or back < TIMES * heat:
        return None
    return Contradiction(
        f"{way.torque}, less what accelerates its inertia, has the sign against the slip: "
        f"surfaces that slide would give back {back / 1e3:.3g} kJ",
        way.torque,
        float(time[np.flatnonzero(energy < 0.0)[0]]),
        f"the sign of {way.torque} is wrong, or {way.speed} and {way.other} are swapped",
        "sign",
        (way.speed, way.other),
    )
