"""A curve as a file of effects: what has no name still goes into the model."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from clutchest.discovery.leftover import Curve
from clutchest.models import flaws_of, peaks_of
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


class Patch(Effect):
    """`{signal}` arrives late by so many s, times `size`."""

    name = "{name}"
    model = "{model}"
    equation = "{equation}"
    parameters = (Number("size", "1", 0.0, 2.0),)
    delays = {{"{signal}": "size"}}
    lateness = {{"{signal}": Lateness("{driver}", {knots}, {seconds})}}
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


class Patch(Effect):
    """The equation `{equation}` is off by a curve over `{driver}`, times `size`."""

    name = "{name}"
    model = "{model}"
    equation = "{equation}"
    parameters = (Number("size", "1", 0.0, 2.0),)
    states = {states}

    def terms(self, g):
        """See :meth:`Effect.terms`."""

        def changed(quantity, change):
            def by_curve(value, q):
                at = {at}
                return change(value, g.size * curve(at))

            return by_curve

        changes = FLAWS["{flaw}"].changes.items()
        found = {{quantity: changed(quantity, change) for quantity, change in changes}}{rate}
        return found
{kept}

def curve(at):
    """The error at a value of the driver."""
    value = VALUES[0] + 0.0 * at
    for left, right, a, b in zip(KNOTS, KNOTS[1:], VALUES, VALUES[1:]):
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


def text(curve: Curve, model: Model, name: str = NAME) -> str | None:
    """Python source of the effect ``name``, None where the equations cannot see what it depends
    on."""
    flaw = flaws_of(model.name)[curve.flaw]
    if flaw.late is not None:
        signal, per_unit = flaw.late
        return _LATE.format(
            signal=signal, driver=curve.driver, name=name, model=model.name,
            equation=curve.equation, knots=_numbers(curve.at),
            seconds=_numbers(per_unit * curve.coefficients),
        )  # fmt: skip
    changes = flaw.changes
    peaks = peaks_of(model.name)
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
        flaw=curve.flaw,
        driver=curve.driver,
        at=at,
        name=name,
        model=model.name,
        knots=_numbers(curve.at),
        values=_numbers(curve.coefficients),
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
