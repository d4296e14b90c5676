"""A user's own effects in the generator's truck, which shares no equations with the model.

What an effect changes of the model's quantities, at the true state, is handed to the generator as
a torque, a heat flow, a shift of the zero position, a load of the engine, or a reading.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from clutchest.errors import ClutchestError
from clutchest.models.dry_clutch.equations import DRY_CLUTCH
from clutchest.models.effects import Effect
from clutchest.models.local_changes import LocalChanges
from clutchest.signals import Floats

SMALL = 5.0  # Nm: below, a share of the torque is no number
SLIPS = 0.1  # rad/s; below, the engine turns with the gearbox
TURNS = 4  # of the iteration from a truth to its reading
READ = ("engine_torque", "input_shaft_speed", "slave_position", "coolant_temp", "ambient_temp")
HEAT = {  # the generator's heat flow → rate, heat capacity
    "body_heat": ("temp_body_rate", "heat_capacity_body"),
    "housing_heat": ("temp_housing_rate", "heat_capacity_housing"),
    "disc_heat": ("temp_disc_rate", "heat_capacity_disc"),
}
TOLD = (
    "expansion",
    "sliding_torque",
    "drag_torque",
    "power",
    "true_engine_torque",
    "engine_speed_rate",
    "zero_position_rate",
    "initial_zero_position",
    *HEAT,
    *(rate for rate, _ in HEAT.values()),
)

Reading = Callable[[Floats], Floats]
Law = Callable[[Mapping[str, float]], Mapping[str, float]]


class OwnEffects:
    """These ``effects`` (effect → its numbers) as the generator's truck takes them; ``parameters``
    of the vehicle file.  See :class:`clutchest.generator.Outsider`.  Raises ClutchestError for one
    that the generator cannot be told of."""

    def __init__(
        self, effects: Mapping[Effect, Mapping[str, float]], parameters: Mapping[str, float]
    ) -> None:
        for effect in effects:
            if effect.states or effect.lateness or "after_step" in vars(type(effect)):
                raise _untold(effect, "has a state, a step map or a delay that varies")
        self._effects, self._parameters = effects, parameters
        self._changes = LocalChanges.by(effects, DRY_CLUTCH, parameters, (*READ, *TOLD))
        for name, key in self._changes.idle:
            effect = next(e for e in effects if e.name == name)
            raise _untold(effect, f"has {key}, which changes nothing that the generator knows")
        self._times: list[float] = []
        self._states: list[Floats] = []

    def law(self) -> Law:
        """What acts on the truck."""
        self._times.clear()
        self._states.clear()
        worn, before = 0.0, 0.0

        def act(seen: Mapping[str, float]) -> dict[str, float]:
            nonlocal worn, before
            x, u = self._state(seen), self._inputs(seen)
            self._times.append(seen["time"])
            self._states.append(x)
            changes, values = self._changes.of(x, u)
            change = dict(zip(self._changes.names, changes[:, 0], strict=True))
            torque = values[self._changes.names.index("sliding_torque"), 0]
            worn += change["zero_position_rate"] * (seen["time"] - before)
            before = seen["time"]
            load = -change["true_engine_torque"]
            if abs(seen["slip_speed"]) > SLIPS:
                load -= change["engine_speed_rate"] * self._parameters["engine_inertia"]
            heat = {
                name: change[name] + change[rate] * self._parameters[capacity]
                for name, (rate, capacity) in HEAT.items()
            }
            heat["disc_heat"] += change["power"]
            drag, slip = change["drag_torque"], seen["slip_speed"]
            if torque <= 0.0:  # the generator's clutch is open, and carries no torque
                load += drag
                heat["disc_heat"] += drag * slip
            return {
                "torque_share": change["sliding_torque"] / torque if torque > SMALL else 0.0,
                "torque": drag * float(np.sign(slip)) if torque > 0.0 else 0.0,
                "engine_load": load,
                "zero_position": worn + change["expansion"] + change["initial_zero_position"],
                **heat,
            }

        return act

    def readings(self, true: Mapping[str, Reading]) -> Mapping[str, Reading]:
        """What the sensors show: the readings of which the effects make the truth."""
        shown = {**true, **{name: self._shown(name, true) for name in READ}}
        for effect, numbers in self._effects.items():
            for signal, key in effect.delays.items():
                shown[signal] = _delayed(shown[signal], numbers[key])
        return shown

    def _shown(self, name: str, true: Mapping[str, Reading]) -> Reading:
        row, own = self._changes.names.index(name), DRY_CLUTCH.input(name)

        def at(t: Floats) -> Floats:
            truth = true[name](t)
            x = np.array(
                [np.interp(t, self._times, column) for column in np.transpose(self._states)]
            )
            inputs = {item.name: true[item.name] for item in DRY_CLUTCH.inputs if item.name in true}
            u = np.array(
                [
                    inputs[item.name](t) if item.name in inputs else np.zeros(len(t))
                    for item in DRY_CLUTCH.inputs
                ]
            )
            for _ in range(TURNS):
                changes, _ = self._changes.of(x, u)
                u[own] = truth - changes[row]
            return np.asarray(u[own])

        return at

    def _state(self, seen: Mapping[str, float]) -> Floats:
        known = {"zero_position": self._parameters["zero_position_ref"], "friction": 1.0}
        values = {**known, **seen}
        return np.array([values.get(state.name, 0.0) for state in DRY_CLUTCH.states])

    def _inputs(self, seen: Mapping[str, float]) -> Floats:
        return np.array([seen.get(item.name, item.default or 0.0) for item in DRY_CLUTCH.inputs])


def _delayed(of: Reading, by: float) -> Reading:
    return lambda t: of(np.maximum(t - by, 0.0))


def _untold(effect: Effect, why: str) -> ClutchestError:
    return ClutchestError(
        f"effect '{effect.name}' {why}: the truck's generator, which shares no equations with the "
        "model, cannot simulate it"
    )
