"""Smooth errors of equations: what a curve that is off by a percent here and there does.

The error is a Gaussian process over its covariate, with a squared-exponential covariance (C.
Rasmussen, C. Williams, Gaussian Processes for Machine Learning, 2006, section 4.2), told by its
values at knots that lie closer than it bends.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from clutchest.inference.covariates import covariate
from clutchest.inference.linearisation import Modulation, modulated
from clutchest.inference.operating_point import ModelNumbers, OperatingPoint
from clutchest.inference.prepared_drive import PreparedDrive
from clutchest.inference.unknowns import of_compiled
from clutchest.models.error_term_effects import PREFIX
from clutchest.signals import Floats
from clutchest.vehicle import SmoothError

APART = 0.5  # lengths between knots
MOST = 64  # knots
ABSENT = 1e-3  # of the largest variance: what curves of this smoothness hardly have


def smooth_error(
    drive: PreparedDrive, numbers: ModelNumbers, at: OperatingPoint, error: SmoothError
) -> Floats:
    """What a smooth error of an equation does to the readings of a drive at these ``numbers``:
    columns (K, c), each to be taken a number of times that is normal, of variance 1; none where
    the drive does not have the covariate."""
    machine = drive.compiled.machine
    values = covariate(drive, at, error.covariate, machine.smooth_over)
    if values is None:
        return np.zeros((len(drive.readings.t), 0))
    term = machine.error_terms[error.error_term]
    knots = _knots(values, error.length)
    parts = error.std / term.size * _root(knots / error.length)
    basis = np.column_stack([np.interp(values, knots, part) for part in parts.T])
    theta = [str(t) for t in of_compiled(drive.compiled, {})].index(acting(error))
    count = basis.shape[1]
    every = Modulation(basis, np.arange(count))
    return modulated(drive, numbers, at, np.full(count, theta), every)


def acting(error: SmoothError) -> str:
    """The name of the unknown by which an error acts."""
    return f"{PREFIX}{error.error_term}.size"


def acting_by(known: Iterable[str], errors: Iterable[SmoothError]) -> list[SmoothError]:
    """Those of the errors that act by an unknown which is ``known``, by name."""
    names = set(known)
    return [error for error in errors if acting(error) in names]


def _knots(values: Floats, length: float) -> Floats:
    """Over all ``values``, in the unit of the covariate."""
    low, high = float(values.min()), float(values.max())
    count = int(np.clip(np.ceil((high - low) / (APART * length)) + 1, 2, MOST))
    return np.linspace(low, max(high, low + length), count)


def _root(places: Floats) -> Floats:
    """Columns (n, c) whose products are the covariance of values at ``places`` (n), in lengths."""
    covariance = np.exp(-0.5 * np.subtract.outer(places, places) ** 2)
    variance, directions = np.linalg.eigh(covariance)
    kept = variance > ABSENT * variance[-1]
    return np.asarray(directions[:, kept] * np.sqrt(variance[kept]))
