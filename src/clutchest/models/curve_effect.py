"""The effect ``curve``: an error of one equation as a curve over one covariate, with its knots and
values in the vehicle file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import reduce
from typing import Any

import numpy as np

from clutchest.casadi_later import ca
from clutchest.models.declarations import ENERGY, RECENT, RECENT_SLIP, TURN
from clutchest.models.effects.effect import TIME, Effect, Gains, Indices, Lateness, Number
from clutchest.models.error_curve import DEVIATION, SIZE, ErrorCurve, effect_of_deviation
from clutchest.models.error_terms import ErrorTerm
from clutchest.models.machine import Machine
from clutchest.models.model import Model
from clutchest.models.symbols import State
from clutchest.signals import Floats

FORGOTTEN = 0.02  # s: time constant with which a duration that has ended goes back to 0
LEAST_WEIGHT = 1e-9  # of a mean of late, as the drive begins
LARGEST = 4.0  # standard deviations by which a curve may be shifted
# Covariates that are no quantity of the equations: states of the curve's own, and their rates.
_OWN_STATES: Mapping[str, tuple[str, str, Callable[[Any, Any], Any]]] = {
    ENERGY: ("J", "slip energy since the start", lambda q, x: q.power),
    RECENT_SLIP: (
        "1",
        "share of the last half minute with slip",
        lambda q, x: (ca.if_else(q.power > 0.0, 1.0, 0.0) - x) / RECENT,
    ),
    TIME: ("s", "time since the start", lambda q, x: 1.0),
}


def curve_effects(name: str, curve: ErrorCurve, machine: Machine) -> tuple[Effect, ...]:
    """The effects that the curve ``name`` puts into a machine's equations; first the curve itself.

    The covariate must be one of :func:`covariates_of_curve`.
    """
    error_term = machine.error_terms[curve.error_term]
    if error_term.late is None:
        return (_of_equation(name, curve, error_term, machine),)
    parts = [(name, np.array(curve.values))]
    parts += [(effect_of_deviation(name, k), d) for k, d in enumerate(curve.deviations, 1)]
    return tuple(_of_delay(each, curve, values, error_term, machine.name) for each, values in parts)


def covariates_of_curve(
    error_term: ErrorTerm, machine: Machine, model: Model | None = None
) -> tuple[str, ...]:
    """Covariates that a curve of this error term may have: what the equations (those of a
    ``model``, the fullest unless given) compute before the first quantity that it changes."""
    if error_term.late is not None:
        return (TIME, *machine.units)
    model = model or machine.equations(machine.units)
    names = model.expressions().quantities.names()
    first = min(names.index(quantity) for quantity in error_term.changes if quantity in names)
    made = {**machine.turns, **machine.departures, **machine.durations}
    states = {state.name for state in machine.states}
    made_of_known = [name for name, of in made.items() if of in names or of in states]
    own = [name for name in _OWN_STATES if name == TIME or "power" in names]
    # of the changed quantities the first one: a reading's error may depend on the reading itself
    return (*own, *machine.peaks, *made_of_known, *names[: first + 1])


def _of_equation(name: str, curve: ErrorCurve, error_term: ErrorTerm, machine: Machine) -> Effect:
    own, peak_of = f"{name}_{curve.covariate}", machine.peaks.get(curve.covariate)
    turning = curve.covariate in machine.turns
    brought, covariate, rates = _memory(own, curve.covariate, peak_of, machine)
    departs = machine.departures.get(curve.covariate)
    deviations = curve.deviations
    keys = tuple(f"{DEVIATION}_{k}" for k in range(1, len(deviations) + 1))

    class EquationCurve(Effect):
        """An error of one equation as a curve over one covariate."""

        equation = error_term.equation
        parameters = tuple(Number(key, "1", -LARGEST, LARGEST) for key in (SIZE, *keys))
        states = brought

        def terms(self, g: Gains) -> Mapping[str, Any]:
            """See :meth:`Effect.terms`."""

            def changed(quantity: str, change: Callable[[Any, Any], Any]) -> Any:
                def by_curve(value: Any, q: Any) -> Any:
                    def now(name: str) -> Any:
                        # the error of a reading that depends on the reading itself
                        return value if quantity == name else getattr(q, name)

                    at = _within_turn(now(covariate)) if turning else now(covariate)
                    if departs is not None:
                        at = now(departs) - at / ca.fmax(now(_weight(own)), LEAST_WEIGHT)
                    error = getattr(g, SIZE) * _interpolated(at, curve.knots, curve.values)
                    for key, deviation in zip(keys, deviations, strict=True):
                        error += getattr(g, key) * _interpolated(at, curve.knots, deviation)
                    return change(value, error)

                return by_curve

            terms = {quantity: changed(quantity, c) for quantity, c in error_term.changes.items()}
            return terms | {f"{state}_rate": _added(rate) for state, rate in rates.items()}

        def after_step(self, model: Indices, x: Any, u0: Any, u: Any, g: Gains) -> Any:
            """See :meth:`Effect.after_step`."""
            if peak_of is None:
                return x
            row, now = model.state(own), x[model.state(peak_of)]
            mapped = ca.SX(x)
            mapped[row] = ca.if_else(x[row] < now, now, x[row])
            return mapped

    EquationCurve.name, EquationCurve.model = name, machine.name
    return EquationCurve()


def _memory(
    own: str, covariate: str, peak_of: str | None, machine: Machine
) -> tuple[tuple[State, ...], str, Mapping[str, Callable[[Any], Any]]]:
    """The states that a curve needs for a covariate which the equations do not have, the name of
    the quantity that it then reads, and the states' rates."""
    if covariate in _OWN_STATES:
        unit, what, rate = _OWN_STATES[covariate]
        slow = State(own, unit, "", what, 0.0, 0.0, 1.0)
        return (slow,), own, {own: lambda q: rate(q, getattr(q, own))}
    if peak_of is not None:
        unit = next(state.unit for state in machine.states if state.name == peak_of)
        return (State(own, unit, "", f"highest {peak_of} so far", 0.0, 0.0, 1.0),), own, {}
    if (of := machine.departures.get(covariate)) is not None:
        return _mean_of_late(own, of)
    if (of := machine.durations.get(covariate)) is not None:
        what = f"for how long {of} has been positive"
        duration = State(own, "s", "", what, 0.0, 0.0, 1.0, stiff=True)

        def lasts(q: Any) -> Any:
            return ca.if_else(getattr(q, of) > 0.0, 1.0, -getattr(q, own) / FORGOTTEN)

        return (duration,), own, {own: lasts}
    angle = machine.turns.get(covariate, covariate)
    if covariate not in machine.turns or angle in {state.name for state in machine.states}:
        return (), angle, {}
    turned = State(own, "rad", "", f"angle by {angle}", 0.0, 0.0, 1.0)
    flags = machine.equations(machine.units).regime

    def turns(q: Any) -> Any:
        """Where no flag is set, nothing turns, and a speed is a random walk."""
        moves = [getattr(q, flag) for flag in flags]
        return getattr(q, angle) * (reduce(ca.fmax, moves) if moves else 1.0)

    return (turned,), own, {own: turns}


def _mean_of_late(
    own: str, of: str
) -> tuple[tuple[State, ...], str, Mapping[str, Callable[[Any], Any]]]:
    """A sum of late, with weights that fade, and the sum of these, which is not 1 at first."""
    weight = _weight(own)
    summed = State(own, "1", "", f"{of} of late, by its weight", 0.0, 0.0, 1.0)
    weights = State(weight, "1", "", f"weight of {of} of late", 0.0, 0.0, 1.0)
    rates = {
        own: lambda q: (getattr(q, of) - getattr(q, own)) / RECENT,
        weight: lambda q: (1.0 - getattr(q, weight)) / RECENT,
    }
    return (summed, weights), own, rates


def _weight(own: str) -> str:
    return f"{own}_weight"


def _added(rate: Callable[[Any], Any]) -> Callable[[Any, Any], Any]:
    return lambda value, q: value + rate(q)


def _within_turn(angle: Any) -> Any:
    return angle - TURN * ca.floor(angle / TURN)


def _of_delay(
    name: str, curve: ErrorCurve, values: Floats, error_term: ErrorTerm, of_model: str
) -> Effect:
    assert error_term.late is not None
    signal, per_unit = error_term.late
    seconds = tuple(float(v) for v in per_unit * np.asarray(values))

    class DelayCurve(Effect):
        """The delay of a signal as a curve over one covariate."""

        equation = error_term.equation
        parameters = (Number(SIZE, "1", -LARGEST, LARGEST),)
        delays = {signal: SIZE}
        lateness = {signal: Lateness(curve.covariate, curve.knots, seconds)}

    DelayCurve.name, DelayCurve.model = name, of_model
    return DelayCurve()


def _interpolated(at: Any, knots: Any, values: Any) -> Any:
    """The curve at a value of its covariate."""
    value = float(values[0]) + 0.0 * at
    for left, right, a, b in zip(knots, knots[1:], values, values[1:], strict=False):
        share = ca.fmin(ca.fmax((at - left) / (right - left), 0.0), 1.0)
        value += float(b - a) * share
    return value
