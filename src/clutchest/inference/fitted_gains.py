"""Gains by which states are tracked, at numbers near the most probable ones.

Gains stay as they are while a fit goes on, so that innovations are a smooth function of θ.  Those
at the vehicle file's numbers may be of another motion: where a motor sticks there and creeps in
truth, a reading that it lags behind seems to have bent its bristle, on and on.  So growing parts of
the time are fitted.  A fit that ends far from the file's numbers has met another motion still, or a
cause that acts like a number far off: whether it does, a longer part tells.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from clutchest.inference.map_fit import cooled, improve, is_near
from clutchest.inference.objective import Objective
from clutchest.inference.problem import Problem
from clutchest.inference.white_linearisation import Linearisation
from clutchest.signals import Floats

PARTS = (0.0625, 0.25, 0.5, 1.0)  # of a drive's time, fitted one after the other: errors sum up
FAR = 6.0  # standard deviations of its spread, that no number is off from one part to the next
ALIKE = 1.0  # the same: gains at numbers that are less off are as good


class _Fitted(NamedTuple):
    """A part of the time, with its gains, and its most probable numbers."""

    part: Problem
    fit: Linearisation

    @property
    def cost(self) -> float:
        """Of a fit that leads somewhere."""
        return self.fit.cost if is_near(self.fit) else np.inf

    def within_reach(self, near: Floats) -> bool:
        """Whether no number is far off those of a shorter part, ``near`` (m)."""
        return bool(np.all(np.abs(self.fit.theta - near)[self.part.nuisances] < FAR))


def with_fitted_gains(problem: Problem) -> Problem:
    """The problem with states tracked by the gains at its most probable numbers without a cause, by
    those at the file's where none are tracked throughout; with what noise of the inputs does
    there."""
    if not problem.compiled.model.tracked:
        return problem.with_input_noise_at(problem.near)
    near, far = problem.near, None
    for share in PARTS:
        whole = problem if share == 1.0 else problem.until(share)
        beyond = None if far is None else _fitted(whole, far)
        told = beyond is not None and is_near(beyond.fit) and beyond.within_reach(near)
        if not told:
            fitted = _fitted(whole, near)
            if not np.isfinite(fitted.fit.cost):  # where numbers of a shorter part run away
                fitted = _fitted(whole, near := problem.near)
            told = beyond is not None and beyond.cost <= fitted.cost
        if beyond is not None and told:
            fitted = beyond
        if told or fitted.within_reach(near):
            near, far = fitted.fit.theta, None
        else:
            far = fitted.fit.theta
    part, fit = fitted
    if np.any(np.abs(near - part.near)[problem.nuisances] > ALIKE):
        part = problem.with_gains_at(near)
    return replace(part.with_input_noise_at(near), begin=fit.theta)


def _fitted(part: Problem, near: Floats) -> _Fitted:
    """The most probable numbers of a part of the time, with states tracked by the gains at numbers
    ``near`` (m), from these on."""
    part = part.with_gains_at(near) if near.any() else part
    objective, free = Objective.of(part), part.nuisances
    with np.errstate(over="ignore", invalid="ignore"):  # of a fit that leads nowhere
        begun = cooled(objective, objective.linearise_at(near, active=free), free)
        return _Fitted(part, improve(objective, begun, free, derivatives=False))
