"""Curves that explain more than causes with names do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from clutchest.discovery.cause_set import CauseSet
from clutchest.discovery.form_test import TestedForm
from clutchest.discovery.residual_curves import Curve, CurvesAt
from clutchest.discovery.search import CLOSE, Search

CONTAINED = 1e-2  # of what a cause does, squared: what a curve that contains it may lack


def better_as_curve(
    search: Search,
    best: CauseSet,
    forms: Mapping[str, TestedForm],
    explained: float,
    errors: Sequence[Curve],
) -> bool:
    """Whether one curve of the ``errors`` without a cause explains clearly more than the best did
    where that is one cause, as much as two, or nearly as much as three, each chosen among many;
    ``explained``: 2 Δ ln L.

    A curve that contains several causes, as a straight line over a reading does its bias and its
    gain, explains at least what they do: as long as the ``forms`` of these hold, it is no other
    error.
    """
    count = len(best.causes)
    better = [each for each in errors if each.worth > explained + CLOSE * (2 - count)]
    refuted = any(tested.form.refuted for tested in forms.values())
    if not better or count < 2 or refuted:
        return bool(better)
    fit = search.objective.white_at(best.fit.theta, best.fit.shapes)
    at = CurvesAt.of(search.objective, fit)
    return any(not contains(at, best, each) for each in better)


def contains(at: CurvesAt, h: CauseSet, curve: Curve) -> bool:
    """Whether some curve over the same covariate, in the same way, does what each cause of a set
    does, to first order; ``at`` the fit of these."""
    columns = at.by_coefficients(curve)
    own = at.fit.by(np.array([cause.index for cause in h.causes]))
    lacks = own - columns @ np.linalg.lstsq(columns, own, rcond=None)[0]
    return bool(np.all(np.sum(lacks**2, axis=0) < CONTAINED * np.sum(own**2, axis=0)))
