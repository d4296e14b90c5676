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

from clutchest.errors import ClutchestError
from clutchest.inference.map_fit import FINE, improve
from clutchest.inference.objective import Objective
from clutchest.inference.problem import INDEPENDENT, Problem
from clutchest.inference.sensor_ends import settled_off_ends
from clutchest.inference.unknowns import UnknownParameter
from clutchest.inference.while_sliding import while_sliding
from clutchest.inference.white_linearisation import Linearisation
from clutchest.models.effects import Effect
from clutchest.progress import Progress
from clutchest.signals import Floats, Signals
from clutchest.vehicle import Vehicle

NO_OTHERS: Mapping[str, float] = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class Posterior:
    """The most probable numbers: the ``fit`` that makes an ``objective`` least, and the
    ``covariance`` (m, m), in units of the priors' standard deviations."""

    objective: Objective
    fit: Linearisation
    covariance: Floats

    @property
    def theta(self) -> Floats:
        """The most probable numbers (m), in units of the priors' standard deviations."""
        return self.fit.theta

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
    """All numbers of a problem at once: the fit of :mod:`~clutchest.inference.map_fit`, to where a
    step promises nothing any more, parameters within what the equations allow."""
    if progress:
        progress("fitting", None)
    free = problem.nuisances
    objective, fit = settled_off_ends(problem)
    problem = objective.problem
    fit = improve(objective, fit, free, FINE)
    fit = objective.relinearise(fit, fit.theta)
    psi = objective.in_span(fit.psi[:, free])
    inverse = np.asarray(np.linalg.inv(psi.T @ psi + np.eye(len(free))), np.float64)
    covariance = np.zeros((len(fit.theta), len(fit.theta)))
    covariance[np.ix_(free, free)] = widened(inverse, fit, free, problem.blocks(INDEPENDENT))
    return Posterior(objective, fit, covariance)


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
