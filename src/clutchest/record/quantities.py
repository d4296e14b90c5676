"""The quantities of a run and of a machine, as plots and tables call them."""

from __future__ import annotations

import numpy as np

from clutchest.estimate.run import OTHER_COLUMNS, Run
from clutchest.models.machine import Machine
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


def quantity_of(machine: Machine, name: str) -> Quantity:
    """A state, a canonical column or what else an error may correlate with, by name."""
    states = {s.name: s.unit for s in machine.states}
    rates = {rate: f"{machine.units.get(of, '1')}/s" for rate, of in machine.rates.items()}
    peaks = {peak: states[of] for peak, of in machine.peaks.items()}
    units = {"time": "s", "energy": "J", **machine.covariates, **rates, **peaks}
    units |= machine.units | states
    return Quantity(name, units.get(name, "1"))
