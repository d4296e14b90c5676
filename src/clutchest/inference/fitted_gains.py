"""Gains by which states are tracked, at numbers near the most probable ones.

Gains stay as they are while a fit goes on, so that innovations are a smooth function of θ.  Those
at the vehicle file's numbers may be of another motion: where a motor sticks there and creeps in
truth, a reading that it lags behind seems to have bent its bristle, on and on.  A fit that ends far
from them, or nowhere, has met another motion still, and says nothing.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from clutchest.inference.map_fit import cooled, improve
from clutchest.inference.objective import Objective
from clutchest.inference.problem import Problem

PARTS = (0.0625, 0.25, 0.5, 1.0)  # of a drive's time, fitted one after the other: errors sum up
FAR = 6.0  # standard deviations of its spread, that no number of a specimen is off


def with_fitted_gains(problem: Problem) -> Problem:
    """The problem with states tracked by the gains at its most probable numbers without a cause;
    as it is where none are tracked throughout."""
    if not problem.compiled.model.tracked:
        return problem
    near, free = problem.near, problem.nuisances
    for share in PARTS:
        part = problem.until(share)
        if near.any():
            part = part.with_gains_at(near)
        objective = Objective.of(part)
        with np.errstate(over="ignore", invalid="ignore"):  # of a fit that leads nowhere
            begun = cooled(objective, objective.linearise_at(near, active=free), free)
            fitted = improve(objective, begun, free, derivatives=False).theta
        met = bool(np.all(np.abs(fitted[free]) < FAR))
        near = fitted if met else near
    if met or not near.any():
        part = problem.with_gains_at(near)
    return replace(part.with_input_noise_at(near), begin=fitted)
