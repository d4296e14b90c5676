"""Structural detectability: the sensors that a fault can affect, by the equations alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from clutchest.models.effects import Effect
from clutchest.models.model import Model

Bools = NDArray[np.bool_]


def affected_sensors(
    model: Model, effects: Sequence[tuple[str, Effect, str]]
) -> Mapping[str, tuple[str, ...]]:
    """Fault → the sensors that its gain affects, each with the states through which it does.

    ``effects``: (fault, effect, key of its gain).  A fault affects a reading that depends on it,
    and every one that depends on a state whose rate or initial value does, however indirectly and
    in any mode.  Two faults that affect the same sensors can only be isolated by magnitude and
    time, not by structure.
    """
    model = model.with_effects(tuple(dict.fromkeys(effect for _, effect, _ in effects)))
    e = model.expressions()
    numbers = [(effect.name, key) for effect, key in model.numbers]
    n = len(model.states)
    flows, measured = np.eye(n, dtype=bool), np.zeros((len(model.sensors), n), bool)
    modes = []
    for flags in product((0.0, 1.0), repeat=len(model.regime)):
        undoubted = np.zeros(e.w.numel() - len(flags))
        weights = ca.DM(np.concatenate([flags, undoubted]))
        rate, readings, first = (
            ca.simplify(ca.substitute(x, e.w, weights)) for x in (e.rate, e.readings, e.initial)
        )
        flows |= _depends(rate, e.x)
        measured |= _depends(readings, e.x)
        modes.append((rate, readings, first))
    reach = np.linalg.matrix_power(flows.astype(float), n) > 0
    affected = {}
    for fault, effect, key in effects:
        g = e.g[numbers.index((effect.name, key))]
        changed, direct = np.zeros(n, bool), np.zeros(len(model.sensors), bool)
        for rate, readings, first in modes:
            changed |= (_depends(rate, g) | _depends(first, g))[:, 0]
            direct |= _depends(readings, g)[:, 0]
        sensors = []
        for s, sensor in enumerate(model.sensors):
            through = [
                state.name
                for i, state in enumerate(model.states)
                if changed[i] and (measured[s] & reach[:, i]).any()
            ]
            others = [name for name in through if name != sensor.name]
            if direct[s] or (sensor.name in model.renewed and sensor.name in through):
                sensors.append(sensor.name)
            elif through:
                sensors.append(
                    f"{sensor.name} through {', '.join(others)}" if others else sensor.name
                )
        affected[fault] = tuple(sensors)
    return affected


def _depends(expression: ca.SX, on: ca.SX) -> Bools:
    return np.array(ca.DM(ca.jacobian_sparsity(expression, on), 1).full(), bool)
