"""Validation of effects of a user's own file against a machine's equations."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from clutchest import units
from clutchest.casadi_later import ca
from clutchest.errors import ClutchestError, nearest
from clutchest.models.effects import Effect, Gains, Number
from clutchest.models.error_curve import is_curve
from clutchest.models.machine import Machine
from clutchest.models.model import Expressions, Model

POINTS, LEAST, MOST = 40, 1.0, 200.0  # states and inputs at which an effect is tried
SAME = 1e-9  # relative


def why_invalid(effect: Effect, machine: Machine, parameters: Mapping[str, float]) -> str | None:
    """The defect of an ``effect`` for a ``machine``, in words; None for a valid one.

    It must change quantities that the equations assign, by quantities assigned before, into finite
    numbers; at gain 0 it must change nothing.  ``parameters``: values at which that is tried.
    """
    model = machine.equations(machine.units)
    if effect.model not in ("", machine.name):
        return f"is of the model '{effect.model}', expected '{machine.name}'"
    if effect.equation not in (equations := _equations(machine)):
        return f"acts in '{effect.equation}', which is no equation" + nearest(
            effect.equation, equations
        )
    if is_curve(effect.name):
        return "has a name that is kept for curves, expected another"
    if not effect.gains:
        return "has no gain, expected at least one parameter with shape=False"
    for number in effect.parameters:
        if wrong := _wrong_number(number):
            return wrong
    inputs = [item.name for item in model.inputs]
    for signal in effect.delays:
        if signal not in inputs:
            return f"delays '{signal}', which is not an input" + nearest(signal, inputs)
    without = model.expressions()
    known = without.quantities.names()
    own = [f"{state.name}_rate" for state in effect.states]
    try:
        for changed in effect.terms(Gains({n.key: ca.SX.sym(n.key) for n in effect.parameters})):
            if changed not in (*known, *own):
                return f"changes '{changed}', not a quantity of the equations" + nearest(
                    changed, known
                )
        return _defect_of_values(model, effect, without, parameters)
    except AttributeError as error:
        if error.name in known:
            return f"uses '{error.name}' before the equations assign it"
        valid = [n.key for n in effect.parameters] if isinstance(error.obj, Gains) else known
        return f"uses '{error.name}', which does not exist" + nearest(str(error.name), valid)
    except Exception as error:  # the user's code may raise anything
        hint = "; expected ca.fmax, ca.fmin or ca.if_else" if "truth value" in str(error) else ""
        return f"cannot be evaluated: {type(error).__name__}: {' '.join(str(error).split())}{hint}"


def _equations(machine: Machine) -> set[str]:
    """Where errors of a machine, and its own effects, may be."""
    named = [term.equation for term in machine.error_terms.values()]
    named += [effect.equation for effect in machine.effects.values()]
    ends = {f"{end}:{name}" for name in machine.units for end in ("sensor", "timing")}
    return ends | {*named}


def _wrong_number(number: Number) -> str | None:
    """What is wrong with the unit or the bounds of a number, in words; None for nothing."""
    try:
        units.parse(number.unit)
    except ClutchestError as error:
        return f"has {number.key} in {error}"
    between = f"between {number.lower:g} and {number.upper:g}"
    if not number.shape and not number.lower <= 0.0 < number.upper:
        return (
            f"has {number.key} {between}, expected "
            "a lower bound of at most 0 and an upper bound above 0"
        )
    if number.shape and not number.lower <= number.default <= number.upper:
        return f"has {number.key} with default = {number.default:g}, expected one {between}"
    return None


def _defect_of_values(
    model: Model, effect: Effect, without: Expressions, parameters: Mapping[str, float]
) -> str | None:
    """Whether the equations give numbers with an effect in them, and the same ones at gain 0."""
    rng = np.random.default_rng(0)
    n, nu = len(model.states), len(model.inputs)
    x, u = rng.uniform(LEAST, MOST, (POINTS, n)), rng.uniform(LEAST, MOST, (POINTS, nu))
    w = np.ones((POINTS, without.w.numel()))
    p = np.array([parameters.get(q.key, 1.0) for q in model.parameters])
    with_ = model.with_effects((effect,)).expressions()
    absent = np.array([n.default if n.shape else 0.0 for n in effect.parameters])
    present = np.array([n.default if n.shape else n.upper / 2.0 for n in effect.parameters])
    old = without.along(_results(without, n), x, u, w, p, np.zeros(0))
    longer = np.column_stack([x, np.zeros((POINTS, len(effect.states)))])
    at_zero, at_half = (
        with_.along(_results(with_, n), longer, u, w, p, g) for g in (absent, present)
    )
    fine = np.isfinite(old)
    if not np.isfinite(at_zero[fine]).all() or np.any(
        fine.any(axis=1) & ~(fine & np.isfinite(at_half)).any(axis=1)
    ):
        return "makes a quantity that is not a finite number"
    if np.any(np.abs(at_zero - old)[fine] > SAME * np.maximum(np.abs(old), 1.0)[fine]):
        return "changes the equations at gain 0, where it must be absent"
    return None


def _results(e: Expressions, states: int) -> ca.SX:
    """The results that an effect may change, of the model's own ``states``."""
    return ca.vertcat(e.rate[:states], e.readings, e.outputs, e.initial[:states])
