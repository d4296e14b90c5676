"""What a machine's quantities are called on plots and in tables."""

from __future__ import annotations

from clutchest.models.declarations import HISTORY
from clutchest.models.machine import Machine
from clutchest.quantity import Quantity


def quantity_of(machine: Machine, name: str) -> Quantity:
    """A state, a canonical column or what else an error may correlate with, by name."""
    states = {s.name: s.unit for s in machine.states}
    moving = {**machine.covariates, **machine.units}
    rates = {rate: _per_second(moving.get(of, "1")) for rate, of in machine.rates.items()}
    peaks = {peak: states[of] for peak, of in machine.peaks.items()}
    departures = {recent: moving.get(of, "1") for recent, of in machine.departures.items()}
    units = {
        **HISTORY,
        **machine.covariates,
        **machine.smooth_over,
        **rates,
        **peaks,
        **departures,
        **dict.fromkeys(machine.turns, "rad"),
        **dict.fromkeys(machine.durations, "s"),
    }
    units |= {i.name: i.unit for i in machine.inputs} | machine.units | states
    return Quantity(name, units.get(name, "1"))


def _per_second(unit: str) -> str:
    return f"{unit}^2" if unit.endswith("/s") else f"{unit}/s"
