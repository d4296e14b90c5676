"""What a healthy vehicle may have of effects, of parts that its equations leave out, and of starts
other than nominal."""

from __future__ import annotations

from collections.abc import Sequence

from clutchest.inference.unknowns import HealthyPart, Unknown, UnknownGain
from clutchest.models.effects import Effect
from clutchest.models.model import Model
from clutchest.vehicle import Vehicle
from clutchest.vehicle.state_uncertainty import prior_std


def healthy_parts(vehicle: Vehicle, shared: Sequence[Unknown]) -> list[tuple[HealthyPart, int]]:
    """What a healthy vehicle has of the effects, each with the index of its gain."""
    places = {str(t): i for i, t in enumerate(shared) if isinstance(t, UnknownGain)}
    some = [h for h in vehicle.healthy if h.std > 0.0 and h.gain in places]
    return [(HealthyPart(h.effect, h.key, h.std), places[h.gain]) for h in some]


def unmodelled(vehicle: Vehicle) -> dict[str, Effect]:
    """The parts that the equations leave out and a healthy vehicle has, by name."""
    acting = {gain.effect for gain in vehicle.healthy if gain.std > 0.0}
    return {name: e for name, e in vehicle.machine.unmodelled.items() if name in acting}


def healthy_stds(vehicle: Vehicle, model: Model) -> dict[str, float]:
    """State → how far its first value may lie from nominal in a healthy vehicle, where it may."""
    stds = {}
    for state, std in zip(model.states, prior_std(vehicle, model), strict=True):
        if state.name in model.followed or state.name in model.unobservable:
            continue
        if state.healthy_std is not None:
            std = min(std, state.healthy_std)
        if std > 0.0:
            stds[state.name] = float(std)
    return stds
