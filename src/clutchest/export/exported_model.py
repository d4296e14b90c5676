"""What is exported of a vehicle: its equations with the effects in them, and their numbers."""

from __future__ import annotations

import re
from dataclasses import dataclass

import casadi as ca
import numpy as np

from clutchest.estimate.whole_log import present_effects
from clutchest.models.model import POWER, Expressions, Model
from clutchest.vehicle import Vehicle

ROOM = 20.0  # °C, of inputs where nothing else is known


@dataclass(frozen=True, slots=True)
class ExportedModel:
    """``model``: the equations that the vehicle's mapped signals drive, with its effects.

    ``parameters`` by key and ``effects`` by ``effect.number``, with their values; ``inputs`` and
    ``states`` by name, with the values at which they start: a machine at rest, room temperature.
    """

    vehicle: Vehicle
    model: Model
    parameters: dict[str, float]
    effects: dict[str, float]
    inputs: dict[str, float]
    states: dict[str, float]

    @classmethod
    def of(cls, vehicle: Vehicle) -> ExportedModel:
        """Of a vehicle.  Raises ClutchestError for an effect that nothing knows."""
        model = vehicle.machine.equations(frozenset(vehicle.signals))
        model = model.with_effects(model.taking(present_effects(vehicle)))
        parameters = {q.key: vehicle.parameters[q.key].value for q in model.parameters}
        effects = model.effect_numbers(vehicle.effect_numbers)
        warm = {i.name: ROOM if i.unit == "°C" else 0.0 for i in model.inputs}
        inputs = {i.name: warm[i.name] if i.default is None else i.default for i in model.inputs}
        rest = vehicle.machine.at_rest(parameters, inputs)
        e, names = model.expressions(), [state.name for state in model.states]
        begin = ca.Function("begin", [e.x, e.p, e.g], [e.initial])
        start = begin(
            [rest.get(name, 0.0) for name in names], [*parameters.values()], list(effects.values())
        )
        states = dict(zip(names, np.array(start).ravel().tolist(), strict=True))
        return cls(vehicle, model, parameters, effects, inputs, states)

    @property
    def expressions(self) -> Expressions:
        """The equations written out."""
        return self.model.expressions()

    @property
    def flags(self) -> tuple[str, ...]:
        """What the equations are told of the regime: its flags, 1 where they hold, and standard
        deviations of states that they use, 0 where nothing is estimated."""
        return (*self.model.regime, *(f"{name}_std" for name in self.model.doubted))

    @property
    def flag_units(self) -> dict[str, str]:
        """Unit of what the equations are told of the regime."""
        doubted = {
            f"{s.name}_std": s.unit for s in self.model.states if s.name in self.model.doubted
        }
        return dict.fromkeys(self.flags, "1") | doubted

    @property
    def effect_units(self) -> dict[str, str]:
        """Unit of the effects' numbers."""
        return {f"{e.name}.{n.key}": n.unit for e in self.model.effects for n in e.parameters}

    @property
    def output_units(self) -> dict[str, str]:
        """Unit of the outputs, empty where nothing states it."""
        machine = self.vehicle.machine
        known = {machine.output: "Nm", POWER: "W"}
        known |= machine.inverse.columns if machine.inverse else {}
        return {name: known.get(name, "") for name in self.model.outputs}

    @property
    def identifier(self) -> str:
        """The vehicle's name as C takes it."""
        return identifier(self.vehicle.name)


def identifier(name: str) -> str:
    """A name as CasADi takes it in C: a letter, then letters, digits and single underscores."""
    words = re.sub(r"[\W_]+", "_", name, flags=re.ASCII).strip("_")
    return words if re.match(r"[A-Za-z]", words) else f"v_{words}".rstrip("_")
