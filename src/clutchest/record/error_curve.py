"""An error that no known cause explains, in words: how large it is, and where."""

from __future__ import annotations

import numpy as np

from clutchest.discovery.result import Discovery
from clutchest.discovery.where import place_words
from clutchest.models.error_curve import ErrorCurve
from clutchest.models.error_terms import ErrorTerm
from clutchest.models.quantities import quantity_of
from clutchest.quantity import Quantity
from clutchest.shown import rounded, with_unit
from clutchest.signals import Floats

SHOWN = 2.0  # standard deviations from which on the end of a curve is worth a word


def error_curve_words(discovery: Discovery) -> str:
    """How large the error of the curve is and where, at its largest and, where it has both signs,
    at the largest of the other sign; "" without a curve."""
    curve = discovery.extended.curves.get(discovery.curve or "")
    if curve is None:
        return ""
    machine = discovery.vehicle.machine
    term, driver = machine.error_terms[curve.error_term], quantity_of(machine, curve.covariate)
    values, std, unit = in_units(term, curve)
    at = driver.read(np.array(curve.knots))
    first = int(np.argmax(np.abs(values)))
    other = int(np.argmax(-np.sign(values[first]) * values))
    opposite = values[other] * values[first] < 0.0 and abs(values[other]) > SHOWN * std[other]
    ends = [first, other] if opposite else [first]
    words = [
        f"{_off(term, values[k], std[k], unit)} at {at[k]:.4g} {driver.shown}".rstrip()
        for k in ends
    ]
    return f"{_subject(term)} {' and '.join(words)} of {driver.words}."


def in_units(term: ErrorTerm, curve: ErrorCurve) -> tuple[Floats, Floats, str]:
    """Values (c,) of the curve and their standard deviations (c,), and the unit of both."""
    size, unit = (1e3 * term.late[1], "ms") if term.late else (term.size, term.unit)
    return size * np.array(curve.values), size * standard_deviations(curve), unit


def _subject(term: ErrorTerm) -> str:
    """What is off, as the beginning of a sentence."""
    kind, colon, signal = term.equation.partition(":")
    name = Quantity(signal, "1").words
    if not colon:
        return f"The error in {place_words(term.equation)} is"
    return f"The {name} reads" if kind == "sensor" else f"The time stamp of the {name} is"


def _off(term: ErrorTerm, value: float, std: float, unit: str) -> str:
    """By how much, and which way."""
    kind, colon, _ = term.equation.partition(":")
    if not colon:
        return with_unit(f"{'+' if value > 0.0 else ''}{_number(value, std)}", unit)
    size = with_unit(_number(abs(value), std), unit)
    more, less = ("late", "early") if kind == "timing" else ("high", "low")
    return f"{size} {more if value > 0.0 else less}"


def _number(value: float, std: float) -> str:
    return rounded(value, std) if std > 0.0 else f"{value:.3g}"


def standard_deviations(curve: ErrorCurve) -> Floats:
    """Of its values (c,); zero where they are exact."""
    if not curve.covariance:
        return np.zeros(len(curve.values))
    return np.sqrt(np.maximum(np.diag(np.array(curve.covariance)), 0.0))
