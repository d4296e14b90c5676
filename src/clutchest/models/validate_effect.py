"""Why an effect of a user's own file cannot stand in a model's equations."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np

from clutchest.errors import nearest
from clutchest.models.effects import Effect, Gains
from clutchest.models.machine import Machine
from clutchest.models.model import Expressions, Model

POINTS, LEAST, MOST = 40, 1.0, 200.0  # states and inputs at which an effect is tried
SAME = 1e-9  # relative


def why_invalid(effect: Effect, machine: Machine, parameters: Mapping[str, float]) -> str | None:
    """In words, what is wrong with an ``effect`` for a ``machine``; None where nothing is.

    It must change what is there, by what is there before, into numbers; at 0 it must change
    nothing.  ``parameters``: values at which that is tried.
    """
    model = machine.equations(machine.units)
    if effect.model != machine.name:
        return f"is of the model '{effect.model}', expected '{machine.name}'"
    if not effect.gains:
        return "has no number that makes it absent at 0, expected one that is no shape"
    for number in effect.gains:
        if not number.lower <= 0.0 < number.upper:
            return (
                f"has {number.key} between {number.lower:g} and {number.upper:g}, expected "
                "0 or less and more than 0"
            )
    inputs = [item.name for item in model.inputs]
    for signal in effect.delays:
        if signal not in inputs:
            return f"delays '{signal}', which is no input" + nearest(signal, inputs)
    without = model.expressions()
    known = without.quantities.names()
    own = [f"{state.name}_rate" for state in effect.states]
    try:
        for changed in effect.terms(Gains({n.key: ca.SX.sym(n.key) for n in effect.parameters})):
            if changed not in (*known, *own):
                return f"changes '{changed}', which the equations have not{nearest(changed, known)}"
        return _off(model, effect, without, parameters)
    except AttributeError as error:
        if error.name in known:
            return f"asks for '{error.name}' before the equations make it"
        there = [n.key for n in effect.parameters] if isinstance(error.obj, Gains) else known
        return f"asks for '{error.name}', which is not there" + nearest(str(error.name), there)
    except Exception as error:  # whatever the user's file does wrong
        return f"cannot be written out: {type(error).__name__}: {str(error).splitlines()[-1]}"


def _off(
    model: Model, effect: Effect, without: Expressions, parameters: Mapping[str, float]
) -> str | None:
    """What of the equations is no number with an effect in them, or changes though it is at 0."""
    rng = np.random.default_rng(0)
    n, nu = len(model.states), len(model.inputs)
    x, u = rng.uniform(LEAST, MOST, (POINTS, n)), rng.uniform(LEAST, MOST, (POINTS, nu))
    w = np.ones((POINTS, without.w.numel()))
    p = np.array([parameters.get(q.key, 1.0) for q in model.parameters])
    with_ = model.with_effects((effect,)).expressions()
    absent = np.array([n.default if n.shape else 0.0 for n in effect.parameters])
    there = np.array([n.default if n.shape else n.upper / 2.0 for n in effect.parameters])
    old = without.along(_made(without, n), x, u, w, p, np.zeros(0))
    longer = np.column_stack([x, np.zeros((POINTS, len(effect.states)))])
    new, more = (with_.along(_made(with_, n), longer, u, w, p, g) for g in (absent, there))
    fine = np.isfinite(old)
    if np.any(fine.any(axis=1) & ~(fine & np.isfinite(new) & np.isfinite(more)).any(axis=1)):
        return "makes something that is no number"
    both = fine & np.isfinite(new)
    if np.any(np.abs(new - old)[both] > SAME * np.maximum(np.abs(old), 1.0)[both]):
        return "changes the equations at 0, expected that it is absent there"
    return None


def _made(e: Expressions, states: int) -> ca.SX:
    """What an effect may change, of the model's own ``states``."""
    return ca.vertcat(e.rate[:states], e.readings, e.outputs, e.initial[:states])
