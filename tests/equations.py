"""Evaluating a model's equations by name, for tests."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import casadi as ca
import numpy as np

from clutchest.models.model import Model
from clutchest.signals import Floats

Values = Mapping[str, float]


def evaluator(model: Model, names: Sequence[str]) -> Callable[[Values], dict[str, float]]:
    """A function: values of states, inputs, regime flags, parameters and effects' numbers by
    name (an effect's as ``effect.number``; what is not given is 0) → the named quantities.

    A name may also be a state's rate, ``<state>_rate``, or a sensor's ``<sensor>_reading``.
    """
    e = model.expressions()
    function = ca.Function(
        "named", [e.x, e.u, e.w, e.p, e.g], [getattr(e.quantities, name) for name in names]
    )
    order = argument_names(model)

    def evaluate(values: Values) -> dict[str, float]:
        unknown = set(values) - {name for group in order for name in group}
        assert not unknown, f"the model has no {unknown}"
        arguments = [[values.get(name, 0.0) for name in group] for group in order]
        made = function.call([ca.DM(a) for a in arguments])
        return {name: float(value) for name, value in zip(names, made, strict=True)}

    return evaluate


def argument_names(model: Model) -> tuple[tuple[str, ...], ...]:
    """Names of the entries of x, u, w, p and g."""
    return (
        tuple(s.name for s in model.states),
        tuple(i.name for i in model.inputs),
        model.regime,
        tuple(p.key for p in model.parameters),
        tuple(f"{effect.name}.{key}" for effect, key in model.numbers),
    )


def draw(
    rng: np.random.Generator, ranges: Mapping[str, tuple[float, float]], corners: bool = False
) -> dict[str, float]:
    """One value for each name, anywhere in its range or at one of its ends."""
    return {
        name: float(rng.choice((lower, upper)) if corners else rng.uniform(lower, upper))
        for name, (lower, upper) in ranges.items()
    }


def vector(names: Sequence[str], values: Values) -> Floats:
    """Values in the order of ``names``, 0 where there is none."""
    return np.array([values.get(name, 0.0) for name in names])
