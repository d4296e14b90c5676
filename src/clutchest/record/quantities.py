"""What plots and tables call a quantity, and the unit in which people read it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clutchest.estimate.run import Run
from clutchest.models.machine import Machine
from clutchest.signals import Floats
from clutchest.units import convert

# SI is right inside; on a plot people expect what the dashboard and the data sheet say.
_READ_IN = {"m": "mm", "rad/s": "rpm", "m/s": "km/h", "J": "kJ", "W": "kW", "1": ""}


@dataclass(frozen=True, slots=True)
class Quantity:
    """``name`` as in the Parquet file, ``unit`` of the data, ``what`` it is in a few words."""

    name: str
    unit: str
    what: str = ""

    @property
    def shown(self) -> str:
        """The unit people read; empty for a pure number."""
        return _READ_IN.get(self.unit, self.unit)

    @property
    def words(self) -> str:
        """The name as words, without the unit: ``disc temperature``."""
        words = self.name.split("_")
        if words[0] == "temp":
            return " ".join([*words[1:], "temperature"])
        if words[-1] == "temp":
            return " ".join([*words[:-1], "temperature"])
        return " ".join(words)

    @property
    def label(self) -> str:
        """Name and unit, for an axis or a heading."""
        return f"{self.words} [{self.shown}]" if self.shown else self.words

    def read(self, values: Floats | NDArray) -> Floats:
        """``values`` in the shown unit, shape kept."""
        values = np.asarray(values, np.float64)
        return convert(values, self.unit, self.shown or "1")

    def read_spread(self, std: Floats | NDArray) -> Floats:
        """A standard deviation in the shown unit: the scale without the offset."""
        return self.read(std) - self.read(np.zeros(1))[0]


CLUTCH_TORQUE = Quantity("clutch_torque", "Nm", "torque through the clutch")
SLIP_ENERGY = Quantity("slip_energy", "J", "heat made by slipping since the drive began")
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
