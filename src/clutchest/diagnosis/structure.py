"""What rests on what, by the equations alone: the sensors that a fault can affect, and the
estimates that a signal can."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from clutchest.casadi_later import one_at_a_time
from clutchest.models.effects import Effect
from clutchest.models.model import Expressions, Model

Bools = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class AffectedSensor:
    """A ``sensor`` that a fault affects: directly, or ``through`` these states."""

    sensor: str
    through: tuple[str, ...] = ()

    def __str__(self) -> str:
        """In words, as ``diagnosis.json`` has it."""
        return f"{self.sensor} through {', '.join(self.through)}" if self.through else self.sensor


@dataclass(frozen=True, slots=True)
class Dependences:
    """Which state, reading and output of a model depends on which quantity, in some mode.

    ``modes``: rates (n), readings (s) and initial values (n) in each.
    """

    model: Model
    written: Expressions
    modes: tuple[tuple[ca.SX, ca.SX, ca.SX], ...]

    @classmethod
    @one_at_a_time
    def of(cls, model: Model) -> Dependences:
        """That of a model, its effects included."""
        e, modes = model.expressions(), []
        for flags in product((0.0, 1.0), repeat=len(model.regime)):
            undoubted = np.zeros(e.w.numel() - len(flags))
            weights = ca.DM(np.concatenate([flags, undoubted]))
            rate, readings, first = (
                ca.simplify(ca.substitute(x, e.w, weights)) for x in (e.rate, e.readings, e.initial)
            )
            modes.append((rate, readings, first))
        return cls(model, e, tuple(modes))

    def changed(self, by: ca.SX) -> Bools:
        """The states (n) whose rate or initial value depends on a quantity."""
        some = [_depends(rate, by) | _depends(first, by) for rate, _, first in self.modes]
        return np.asarray(np.any(some, axis=0)[:, 0])

    def read(self, by: ca.SX) -> Bools:
        """The sensors (s) whose reading depends on a quantity itself."""
        return np.asarray(np.any([_depends(each, by) for _, each, _ in self.modes], axis=0)[:, 0])

    @property
    def measured(self) -> Bools:
        """The states that readings depend on (s, n)."""
        return np.asarray(np.any([_depends(each, self.written.x) for _, each, _ in self.modes], 0))

    @property
    def reach(self) -> Bools:
        """(n, n): the state of a row depends on that of the column, however indirectly."""
        n = len(self.model.states)
        flows = [_depends(rate, self.written.x) for rate, _, _ in self.modes]
        once = np.eye(n, dtype=bool) | np.any(flows, axis=0)
        return np.asarray(np.linalg.matrix_power(once.astype(float), n) > 0)


def affected_sensors(
    model: Model, effects: Sequence[tuple[str, Effect, str]]
) -> Mapping[str, tuple[AffectedSensor, ...]]:
    """Fault → the sensors that its gain affects, each with the states through which it does.

    ``effects``: (fault, effect, key of its gain).  A fault affects a reading that depends on it,
    and every one that depends on a state whose rate or initial value does, however indirectly and
    in any mode.  Two faults that affect the same sensors can only be isolated by magnitude and
    time, not by structure.
    """
    model = model.with_effects(tuple(dict.fromkeys(effect for _, effect, _ in effects)))
    structure = Dependences.of(model)
    numbers = [(effect.name, key) for effect, key in model.numbers]
    measured, reach = structure.measured, structure.reach
    affected = {}
    for fault, effect, key in effects:
        g = structure.written.g[numbers.index((effect.name, key))]
        changed, direct = structure.changed(g), structure.read(g)
        sensors = []
        for s, sensor in enumerate(model.sensors):
            through = [
                state.name
                for i, state in enumerate(model.states)
                if changed[i] and (measured[s] & reach[:, i]).any()
            ]
            others = tuple(name for name in through if name != sensor.name)
            if direct[s] or (sensor.name in model.renewed and sensor.name in through):
                sensors.append(AffectedSensor(sensor.name))
            elif through:
                sensors.append(AffectedSensor(sensor.name, others))
        affected[fault] = tuple(sensors)
    return affected


def estimates_resting_on(model: Model, signal: str) -> frozenset[str]:
    """The states and outputs of a model whose estimates are wrong while a ``signal`` is.

    Wrong are the states whose rates it drives and those that depend on them; a sensor that is read
    from it, or predicted from what is wrong, corrects every state that it shows.  Nothing rests on
    an input that the equations can do without.
    """
    structure = Dependences.of(model)
    e, reach, measured = structure.written, structure.reach, structure.measured
    wrong = np.zeros(len(model.states), bool)
    misled = np.array([signal in (sensor.name, sensor.column) for sensor in model.sensors])
    outputs = np.zeros(len(model.outputs), bool)
    for j, item in enumerate(model.inputs):
        if signal in (item.name, model.slopes.get(item.name)) and item.default is None:
            wrong |= structure.changed(e.u[j])
            misled |= structure.read(e.u[j])
            outputs |= _depends(e.outputs, e.u[j])[:, 0]
    shows = (measured.astype(int) @ reach.astype(int)) > 0  # (s, n): whose state is in a reading
    for _ in range(len(model.states) + len(model.sensors)):
        wrong |= (reach & wrong).any(axis=1) | shows[misled].any(axis=0)
        misled |= (measured & wrong).any(axis=1)
    outputs |= (_depends(e.outputs, e.x) & wrong).any(axis=1)
    states = {state.name for state, off in zip(model.states, wrong, strict=True) if off}
    return frozenset(states | {o for o, off in zip(model.outputs, outputs, strict=True) if off})


def _depends(expression: ca.SX, on: ca.SX) -> Bools:
    return np.array(ca.DM(ca.jacobian_sparsity(expression, on), 1).full(), bool)
