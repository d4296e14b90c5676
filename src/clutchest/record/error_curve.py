"""An error that no known cause explains, in words: how large it is, and where."""

from __future__ import annotations

import numpy as np

from clutchest.discovery.result import Discovery
from clutchest.models.error_curve import ErrorCurve
from clutchest.models.quantities import quantity_of


def error_curve_words(discovery: Discovery) -> str:
    """Where the error of the curve is largest, and how large, in words; "" without a curve."""
    curve = discovery.extended.curves.get(discovery.curve or "")
    if curve is None:
        return ""
    machine = discovery.vehicle.machine
    term, driver = machine.error_terms[curve.error_term], quantity_of(machine, curve.covariate)
    k = int(np.argmax(np.abs(curve.values)))
    value, std = (float(term.size * each[k]) for each in (curve.values, standard_deviations(curve)))
    at = float(driver.read(np.array(curve.knots))[k])
    unit = "" if term.unit == "1" else f" {term.unit}"
    return (
        f"The error in {term.equation} is largest at {at:.4g} {driver.shown} of {driver.words}: "
        f"{value:+.3g} ± {std:.2g}{unit}."
    )


def standard_deviations(curve: ErrorCurve) -> np.ndarray:
    """Of its values (c,); zero where they are exact."""
    if not curve.covariance:
        return np.zeros(len(curve.values))
    return np.sqrt(np.maximum(np.diag(np.array(curve.covariance)), 0.0))
