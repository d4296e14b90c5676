"""A user's own effects in a generator, which shares no equations with the model.

What an effect changes of the model's quantities, at the true state, is handed to the generator as
something that acts on the machine, or as a reading.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from clutchest.errors import ClutchestError
from clutchest.models.effects import Effect
from clutchest.models.local_changes import LocalChanges
from clutchest.models.model import Model
from clutchest.signals import Floats

if TYPE_CHECKING:
    from clutchest.generator.outsider import Law, Reading

TURNS = 4  # of the iteration from a truth to its reading

Seen = Mapping[str, float]


class OwnEffects(ABC):
    """These ``effects`` (effect → its numbers) as a machine's generator takes them; ``parameters``
    of the vehicle file.  See :class:`clutchest.generator.Outsider`.  Raises ClutchestError for one
    that the generator cannot be told of.

    ``told``: quantities whose change acts on the machine; ``inputs``: those whose readings may be
    wrong; ``sensors``: signal → quantity that is its reading; ``nominal`` gives states of which the
    generator tells nothing; ``wears``: the one of ``told`` whose changes sum up over time.
    """

    machine: ClassVar[str]  # in words
    told: ClassVar[tuple[str, ...]]
    wears: ClassVar[str]
    inputs: ClassVar[tuple[str, ...]]
    sensors: ClassVar[Mapping[str, str]] = {}

    def __init__(
        self, effects: Mapping[Effect, Mapping[str, float]], parameters: Mapping[str, float]
    ) -> None:
        for effect in effects:
            if effect.states or effect.lateness or "after_step" in vars(type(effect)):
                raise self._untold(effect, "has a state, a step map or a delay that varies")
        self._effects, self.parameters, self._model = effects, parameters, self.model()
        names = (*self.inputs, *self.sensors.values(), *self.told)
        self._changes = LocalChanges.by(effects, self._model, parameters, names)
        for name, key in self._changes.idle:
            effect = next(e for e in effects if e.name == name)
            raise self._untold(effect, f"has {key}, which changes nothing that the generator knows")
        self._times: list[float] = []
        self._states: list[Floats] = []

    @abstractmethod
    def model(self) -> Model:
        """The equations whose quantities the effects change."""

    def nominal(self) -> Mapping[str, float]:
        """State → its value where the generator tells none; 0 for any other."""
        return {}

    @abstractmethod
    def acts(
        self, seen: Seen, change: Mapping[str, float], value: Mapping[str, float], worn: float
    ) -> dict[str, float]:
        """What acts, by what is seen, the changes of the quantities and their values, and what has
        summed up of that which wears."""

    def law(self) -> Law:
        """What acts on the machine."""
        self._times.clear()
        self._states.clear()
        names, nominal = self._changes.names, self.nominal()
        worn, before = 0.0, 0.0

        def act(seen: Seen) -> dict[str, float]:
            nonlocal worn, before
            known = {**nominal, **seen}
            x = np.array([known.get(state.name, 0.0) for state in self._model.states])
            inputs = self._model.inputs
            u = np.array([seen.get(item.name, item.default or 0.0) for item in inputs])
            self._times.append(seen["time"])
            self._states.append(x)
            changes, values = self._changes.of(x, u)
            change, value = (
                dict(zip(names, each[:, 0].tolist(), strict=True)) for each in (changes, values)
            )
            worn += change[self.wears] * (seen["time"] - before)
            before = seen["time"]
            return self.acts(seen, change, value, worn)

        return act

    def readings(self, true: Mapping[str, Reading]) -> Mapping[str, Reading]:
        """What the sensors show: of inputs, the readings of which the effects make the truth."""
        shown = dict(true)
        for name in self.inputs:
            if name in true:
                shown[name] = self._input(name, true)
        for name, reading in self.sensors.items():
            if name in true:
                shown[name] = self._sensor(name, reading, true)
        for effect, numbers in self._effects.items():
            for signal, key in effect.delays.items():
                shown[signal] = _delayed(shown[signal], numbers[key])
        return shown

    def _input(self, name: str, true: Mapping[str, Reading]) -> Reading:
        row, own = self._changes.names.index(name), self._model.input(name)

        def at(t: Floats) -> Floats:
            truth, x, u = true[name](t), self._states_at(t), self._inputs_at(t, true)
            for _ in range(TURNS):
                changes, _ = self._changes.of(x, u)
                u[own] = truth - changes[row]
            return np.asarray(u[own])

        return at

    def _sensor(self, name: str, reading: str, true: Mapping[str, Reading]) -> Reading:
        row = self._changes.names.index(reading)

        def at(t: Floats) -> Floats:
            changes, _ = self._changes.of(self._states_at(t), self._inputs_at(t, true))
            return np.asarray(true[name](t) + changes[row])

        return at

    def _states_at(self, t: Floats) -> Floats:
        return np.array([np.interp(t, self._times, one) for one in np.transpose(self._states)])

    def _inputs_at(self, t: Floats, true: Mapping[str, Reading]) -> Floats:
        names = [item.name for item in self._model.inputs]
        return np.array([true[name](t) if name in true else np.zeros(len(t)) for name in names])

    def _untold(self, effect: Effect, why: str) -> ClutchestError:
        return ClutchestError(
            f"effect '{effect.name}' {why}: the {self.machine}'s generator, which shares no "
            "equations with the model, cannot simulate it"
        )


def _delayed(of: Reading, by: float) -> Reading:
    return lambda t: of(np.maximum(t - by, 0.0))
