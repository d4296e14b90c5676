"""Parameters of the equations from logs: the most probable values, given the vehicle file's.

The joint likelihood is that of the filter's innovations, see
:class:`~clutchest.inference.objective.Objective`; every number that has a spread and every drive's
first states are estimated along, within their priors.  So the standard deviation of what a
procedure is after contains what is not known of everything else.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from clutchest.errors import ClutchestError
from clutchest.inference.map_fit import settle
from clutchest.inference.objective import Linearisation, Objective
from clutchest.inference.problem import Problem
from clutchest.inference.unknowns import UnknownParameter
from clutchest.inference.while_sliding import while_sliding
from clutchest.models.effects import Effect
from clutchest.progress import Progress
from clutchest.signals import Floats, Signals
from clutchest.vehicle import Vehicle

NO_OTHERS: Mapping[str, float] = MappingProxyType({})
MOST = 12  # evaluations; the fitter's own steps come close
BLOCK = 1.0  # s; noise of one block says nothing of the next


@dataclass(frozen=True, slots=True)
class Posterior:
    """What is probable: ``theta`` (m) in units of the priors' standard deviations, ``covariance``
    (m, m), and the ``objective`` that they make least, linearised at the ``fit``."""

    objective: Objective
    fit: Linearisation
    theta: Floats
    covariance: Floats

    @property
    def problem(self) -> Problem:
        """The drives, and what is unknown of them."""
        return self.objective.problem

    def of(self, key: str) -> tuple[float, float] | None:
        """Value and standard deviation of a parameter; None where the file gives it no spread."""
        for i, t in enumerate(self.problem.thetas):
            if isinstance(t, UnknownParameter) and t.key == key:
                nominal = self.problem.vehicle.parameters[key].value
                std = float(np.sqrt(self.covariance[i, i]))
                return nominal + float(self.theta[i] * t.unit), std * t.unit
        return None


def problem_of(
    signals: Signals,
    vehicle: Vehicle,
    sensor: str = "",
    effects: Sequence[Effect] = (),
    progress: Progress | None = None,
) -> Problem:
    """The drives as the equations see them; with ``sensor``, its readings alone count; ``effects``
    stand in the equations.

    Raises ClutchestError where they have no reading that depends on any parameter.
    """
    of = next((s for s in vehicle.machine.sensors if s.name == sensor), None)
    column = of.column or of.name if of else ""
    if of and not all(column in drive for drive in signals.drives):
        raise ClutchestError(f"no signal '{column}' in this log: no {_words(sensor)} is read")
    problem = Problem.of(signals, vehicle, effects, progress)
    if sensor:
        problem = problem.only(sensor)
    if not sum(len(drive.readings.t) for drive in problem.drives):
        names = [sensor] if sensor else [s.name for s in problem.compiled.model.sensors]
        what = " or ".join(map(_words, names))
        raise ClutchestError(f"these logs have no reading of {what} that determines any parameter")
    return problem


def _words(name: str) -> str:
    return name.replace("_", " ")


def most_probable(problem: Problem, progress: Progress | None = None) -> Posterior:
    """All numbers of a problem at once."""
    if progress:
        progress("fitting", None)
    objective, fit = settle(Objective.of(problem), np.zeros(len(problem.thetas)))
    low, high = bounds(problem)
    last: list[Linearisation] = [fit]

    def at(theta: Floats) -> Linearisation:
        if np.any(last[0].theta != theta) or last[0].raw[0].active is not None:
            last[:] = [objective.relinearise(last[0], theta.copy())]
        return last[0]

    free = problem.nuisances
    prior = np.eye(len(free))

    def with_held(numbers: Floats) -> Floats:
        theta = fit.theta.copy()
        theta[free] = numbers
        return theta

    found = least_squares(
        lambda x: np.concatenate([objective.in_span(at(with_held(x)).r), x]),
        np.clip(fit.theta[free], low[free], high[free]),
        lambda x: np.vstack([objective.in_span(at(with_held(x)).psi[:, free]), prior]),
        bounds=(low[free], high[free]),
        ftol=1e-6,
        xtol=1e-6,
        gtol=1e-6,
        max_nfev=MOST,
    )
    covariance = np.zeros((len(low), len(low)))
    theta = with_held(found.x)
    inverse = np.linalg.inv(found.jac.T @ found.jac)
    covariance[np.ix_(free, free)] = widened(inverse, at(theta), free, problem.blocks(BLOCK))
    return Posterior(objective, at(theta), theta, covariance)


def widened(
    covariance: Floats, fit: Linearisation, free: NDArray[np.int64], blocks: NDArray[np.int64]
) -> Floats:
    """The ``covariance`` (f, f) of the ``free`` numbers; wider where their scores scatter more from
    block to block than noise of one level makes them (Huber's and White's sandwich)."""
    scores = np.zeros((int(blocks.max()) + 1, len(free)))
    np.add.at(scores, blocks, fit.psi[:, free] * fit.r[:, None])
    robust = covariance @ (scores.T @ scores + np.eye(len(free))) @ covariance
    wider = np.sqrt(np.maximum(np.diag(robust) / np.diag(covariance), 1.0))
    return covariance * np.outer(wider, wider)


def bounds(problem: Problem) -> tuple[Floats, Floats]:
    """What the equations allow (m)."""
    allowed = {p.key: (p.lower, p.upper) for p in problem.compiled.model.parameters}
    low, high = np.full(len(problem.thetas), -np.inf), np.full(len(problem.thetas), np.inf)
    for i, t in enumerate(problem.thetas):
        if isinstance(t, UnknownParameter):
            value = problem.vehicle.parameters[t.key].value
            low[i], high[i] = ((end - value) / t.unit for end in allowed[t.key])
    return low, high


def along(
    posterior: Posterior, drive: int, names: Sequence[str], others: Mapping[str, float] = NO_OTHERS
) -> tuple[Floats, Floats]:
    """(time s (k,), values (len(names), k)) of quantities of the equations while surfaces slide,
    with ``others`` in place of parameters; the states stay what they are."""
    problem, own = posterior.problem, posterior.problem.drives[drive]
    p, g, *_ = problem.numbers(posterior.theta, {})
    for key, value in others.items():
        p[[q.key for q in problem.compiled.model.parameters].index(key)] = value
    time, [values] = while_sliding(own, posterior.fit.implied[drive], names, (p, g))
    return time, values
