"""The quantities of a run, as plots and tables call them."""

from __future__ import annotations

import numpy as np

from clutchest.estimate.run import OTHER_COLUMNS, Run
from clutchest.quantity import Quantity

CLUTCH_TORQUE = Quantity("clutch_torque", "Nm", OTHER_COLUMNS["clutch_torque"])
SLIP_ENERGY = Quantity("slip_energy", "J", OTHER_COLUMNS["slip_energy"])
OUTPUTS = {quantity.name: quantity for quantity in (CLUTCH_TORQUE, SLIP_ENERGY)}


def states_of(run: Run) -> dict[str, Quantity]:
    """The run's states in the order of the model, by name."""
    return {
        s.name: Quantity(s.name, s.unit, s.what)
        for s in run.vehicle.machine.states
        if s.name in run.tracks[0].states
    }


def sensors_of(run: Run) -> dict[str, Quantity]:
    """The run's sensors by name, those that gave at least one event."""
    units = {s.name: s.unit for s in run.vehicle.machine.sensors}
    seen = {
        name: None
        for track in run.tracks
        for k, name in enumerate(track.innovations.names)
        if np.any(track.innovations.sensor == k)
    }
    return {name: Quantity(name, units.get(name, "1")) for name in seen}
