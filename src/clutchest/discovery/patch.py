"""A curve as a file of effects: what has no name still goes into the model."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from clutchest.discovery.residual_curves import Curve
from clutchest.models import machine_of
from clutchest.models.model import Model
from clutchest.signals import Floats

NAME = "patch"
FILE = "patch_effects.py"  # stands beside the vehicle file that names it
# What the equations can see of a driver that is no quantity of theirs: a state of the patch's own.
_OWN_STATES = {
    "energy": ("energy", "J", "slip energy so far", "q.power"),
    "time": ("time", "s", "time since the start", "1.0"),
}

_LATE = '''"""The signal `{signal}` is late by a curve over `{driver}`.

Written by `clutchest discover`.  Between the knots the curve is straight, beyond them it stays.
"""

from clutchest.models.effects import Effect, Lateness, Number

KNOTS = {knots}


class Late:
    """`{signal}` arrives late by a curve of s, times `size`."""

    model = "{model}"
    equation = "{equation}"
    parameters = (Number("size", "1", -4.0, 4.0),)
    delays = {{"{signal}": "size"}}
{curves}'''

_CURVE = '''

class {title}(Late, Effect):
    """{what}"""

    name = "{name}"
    lateness = {{"{signal}": Lateness("{driver}", KNOTS, {seconds})}}
'''

_TEXT = '''"""An error of the equation `{equation}` that goes with `{driver}`.

Written by `clutchest discover`.  Between the knots the curve is straight, beyond them it stays.
"""

import casadi as ca

from clutchest.models.{model} import FLAWS
from clutchest.models.effects import Effect, Number
from clutchest.models.symbols import State

KNOTS = {knots}
VALUES = {values}  # in units of the error, one per knot
# What they may be off by, a standard deviation each way.
BENDS = {bends}


class Patch(Effect):
    """The equation `{equation}` is off by a curve over `{driver}`, times `size`."""

    name = "{name}"
    model = "{model}"
    equation = "{equation}"
    parameters = (
        Number("size", "1", -4.0, 4.0),
        *(Number(f"bend_{{k}}", "1", -4.0, 4.0) for k in range(1, len(BENDS) + 1)),
    )
    states = {states}

    def terms(self, g):
        """See :meth:`Effect.terms`."""

        def changed(quantity, change):
            def by_curve(value, q):
                at = {at}
                error = g.size * curve(at, VALUES)
                for k, bend in enumerate(BENDS, 1):
                    error += getattr(g, f"bend_{{k}}") * curve(at, bend)
                return change(value, error)

            return by_curve

        changes = FLAWS["{flaw}"].changes.items()
        found = {{quantity: changed(quantity, change) for quantity, change in changes}}{rate}
        return found
{kept}

def curve(at, values):
    """The error at a value of the driver."""
    value = values[0] + 0.0 * at
    for left, right, a, b in zip(KNOTS, KNOTS[1:], values, values[1:]):
        share = ca.fmin(ca.fmax((at - left) / (right - left), 0.0), 1.0)
        value += (b - a) * share
    return value
'''

_PEAK = '''
    def after_step(self, model, x, u0, u, g):
        """The highest that `{state}` has been."""
        row, now = model.state("{peak}"), x[model.state("{state}")]
        mapped = ca.SX(x)
        mapped[row] = ca.if_else(x[row] < now, now, x[row])
        return mapped
'''


@dataclass(frozen=True, slots=True)
class Patch:
    """The ``text`` of a file of effects; those that stand in the model with their numbers
    (effect → number → value), and by how much (``spread``) they may be off."""

    text: str
    effects: Mapping[str, Mapping[str, float]]
    spread: Mapping[str, Mapping[str, float]]


def written(curve: Curve, model: Model, known: Iterable[str] = ()) -> Patch | None:
    """The curve as effects that have none of the ``known`` names; None where the equations cannot
    see what it depends on."""
    name = _free_name(known)
    # over time, it is another on another drive
    bends = () if curve.driver == "time" else [row for row in curve.off if any(_numbers(row))]
    keys = [f"bend_{k}" for k in range(1, len(bends) + 1)]
    if machine_of(model.name).error_terms[curve.error_term].late is not None:
        off = {f"{name}_{key}": {"size": 1.0} for key in keys}
        effects = {name: {"size": 1.0}} | {each: {"size": 0.0} for each in off}
        return Patch(_of_a_clock(curve, model, name, bends), effects, off)
    text = _of_an_equation(curve, model, name, bends)
    if text is None:
        return None
    off = {name: dict.fromkeys(keys, 1.0)} if keys else {}
    return Patch(text, {name: {"size": 1.0} | dict.fromkeys(keys, 0.0)}, off)


def _free_name(known: Iterable[str]) -> str:
    """The first that neither a patch has nor one of its bends."""
    taken = {re.sub(r"_bend_\d+$", "", each) for each in known}
    names = (NAME, *(f"{NAME}_{k}" for k in range(2, len(taken) + 3)))
    return next(name for name in names if name not in taken)


def _of_a_clock(curve: Curve, model: Model, name: str, bends: Sequence[Floats]) -> str:
    late = machine_of(model.name).error_terms[curve.error_term].late
    assert late is not None
    signal, per_unit = late
    curves = [(name, "What was found.", curve.coefficients)]
    curves += [
        (f"{name}_bend_{k}", "What it may be off by, a standard deviation one way.", bend)
        for k, bend in enumerate(bends, 1)
    ]
    return _LATE.format(
        signal=signal,
        driver=curve.driver,
        model=model.name,
        equation=curve.equation,
        knots=_numbers(curve.at),
        curves="".join(
            _CURVE.format(
                title=each.title().replace("_", ""),
                what=what,
                name=each,
                signal=signal,
                driver=curve.driver,
                seconds=_numbers(per_unit * values),
            )
            for each, what, values in curves
        ),
    )


def _of_an_equation(curve: Curve, model: Model, name: str, bends: Sequence[Floats]) -> str | None:
    error_term = machine_of(model.name).error_terms[curve.error_term]
    changes = error_term.changes
    peaks = machine_of(model.name).peaks
    at, states, rate, kept = f"q.{curve.driver}", "()", "", ""
    if curve.driver in _OWN_STATES:
        quantity, unit, what, grows = _OWN_STATES[curve.driver]
        quantity = f"{name}_{quantity}"
        at, states = f"q.{quantity}", _state(quantity, unit, what)
        rate = f'\n        found["{quantity}_rate"] = lambda rate, q: rate + {grows}'
    elif curve.driver in peaks:
        of, peak = peaks[curve.driver], f"{name}_{curve.driver}"
        unit = model.states[model.state(of)].unit
        at, states = f"q.{peak}", _state(peak, unit, f"highest {of} so far")
        kept = _PEAK.format(state=of, peak=peak)
    elif curve.driver in changes:  # an error of a reading that goes with the reading itself
        at = f'value if quantity == "{curve.driver}" else q.{curve.driver}'
    elif curve.driver not in _before(model, changes):
        return None
    return _TEXT.format(
        equation=curve.equation,
        error_term=curve.error_term,
        driver=curve.driver,
        at=at,
        name=name,
        model=model.name,
        knots=_numbers(curve.at),
        values=_numbers(curve.coefficients),
        bends=tuple(map(_numbers, bends)),
        states=states,
        rate=rate,
        kept=kept,
    )


def _state(name: str, unit: str, what: str) -> str:
    return f'(State("{name}", "{unit}", "", "{what}", 0.0, 0.0, 1.0),)'


def _numbers(values: Floats) -> tuple[float, ...]:
    return tuple(float(np.round(v, 6)) for v in values)


def _before(model: Model, changes: Mapping[str, object]) -> tuple[str, ...]:
    """Quantities that stand before the first that an error changes."""
    names = model.expressions().quantities.names()
    first = min(names.index(quantity) for quantity in changes if quantity in names)
    return names[:first]
