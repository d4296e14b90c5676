"""How uncertain states are before any data, and what time and slip add to that."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from clutchest.models.model import Model
from clutchest.signals import Floats
from clutchest.vehicle.vehicle import Vehicle


def prior_std(vehicle: Vehicle, model: Model) -> Floats:
    """Standard deviation of every state before any data, shape (n,)."""
    stds = []
    for state in model.states:
        stated = vehicle.estimation.get(state.name)
        std = stated.initial_std if stated else state.initial_std
        nominal = vehicle.parameters.get(state.prior)
        if stated is None and nominal is not None and nominal.spread > 0:
            # the spread of a state's nominal value is the state's prior
            std = nominal.spread / (abs(nominal.value) if state.unit == "1" else 1.0)
        stds.append(std)
    return np.array(stds)


def process_noise(vehicle: Vehicle, model: Model, parked: bool = False) -> Floats:
    """Variance per s, then per J of slip energy, of every state, shape (2n,), by vehicle file or
    model."""
    per_second, per_joule = [], []
    for state in model.states:
        treated = vehicle.estimation.get(state.name, state)  # by the file, else by the model
        adaptive = treated.role == "adaptive"
        density = state.parked_noise if parked else treated.process_noise
        per_second.append(density**2 if adaptive else 0.0)
        per_joule.append(state.slip_noise**2 if adaptive else 0.0)
    return np.array(per_second + per_joule)


class Wander(NamedTuple):
    """A ``state`` that wanders by a ``density``, in its unit over √s."""

    state: str
    density: float


def wander(vehicle: Vehicle, model: Model) -> tuple[Wander, ...]:
    """How far states may wander in a healthy vehicle, where they do: those that readings neither
    renew nor leave unobserved, by vehicle file or model."""
    free = (s for s in model.states if s.name not in {*model.followed, *model.unobservable})
    stated = (Wander(s.name, vehicle.estimation.get(s.name, s).wander) for s in free)
    return tuple(each for each in stated if each.density > 0.0)
