"""What fitted numbers are worth on drives that they were not fitted to."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from clutchest.identify.fit import Validation
from clutchest.identify.likelihood import Posterior, along, problem_of
from clutchest.inference.map_fit import improve, settle
from clutchest.inference.objective import Linearisation, Objective
from clutchest.inference.problem import Problem
from clutchest.models.model import Model
from clutchest.signals import Floats, Signals
from clutchest.vehicle import Vehicle


def validate(holdout: Signals, before: Vehicle, after: Vehicle) -> Validation:
    """Numbers in which the vehicles differ, on ``holdout``: all others are fitted to it within
    their spreads, once with the one and once with the other."""
    problem = problem_of(holdout, before)
    moved = {
        key: p.value - before.parameters[key].value
        for key, p in after.parameters.items()
        if p.value != before.parameters[key].value
    }
    held = {i: moved[str(t)] for i, t in enumerate(problem.thetas) if str(t) in moved}
    problem = problem.holding(*moved)
    theta = np.zeros(len(problem.thetas))
    for i, change in held.items():
        theta[i] = change / problem.units[i]
    objective, new = settle(Objective.of(problem), theta)
    after_all = _errors(objective, new)
    theta = new.theta.copy()
    theta[list(held)] = 0.0
    # by the same noise model
    old = improve(objective, objective.relinearise(new, theta), problem.nuisances)
    before_all = _errors(objective, old)
    logs = dict.fromkeys(Path(s).name for drive in holdout.drives for s in drive.sources)
    return Validation(
        tuple(logs),
        before_all[0],
        after_all[0],
        before_all[1],
        after_all[1],
        0.5 * (_cost(objective, old) - _cost(objective, new)),
    )


def _cost(objective: Objective, fit: Linearisation) -> float:
    """−2 ln(probability) up to a constant."""
    fit = objective.whitened(fit)
    return float(fit.r @ fit.r + np.sum(objective.prior * fit.theta**2))


def _errors(objective: Objective, fit: Linearisation) -> tuple[float | None, float | None]:
    """Root mean square errors of torque and zero position at a fit."""
    problem = objective.problem
    at = Posterior(objective, fit, fit.theta, np.zeros((0, 0)))
    torque, position = [], []
    for i in range(len(problem.drives)):
        _, (measured, modelled) = along(at, i, ("measured_torque", "clutch_torque"))
        torque.append(modelled - measured)
        position.append(zero_position_errors(problem, i, fit.raw[i].r))
    return _rms(np.concatenate(torque)), _rms(np.concatenate(position))


def zero_position_rows(problem: Problem, drive: int) -> NDArray[np.intp]:
    """Which of a drive's readings are of the zero position."""
    model: Model = problem.compiled.model
    return np.flatnonzero(problem.drives[drive].readings.sensor == model.sensor("zero_position"))


def zero_position_errors(problem: Problem, drive: int, r: Floats) -> Floats:
    """Measured less modelled zero position (k,), mm, from a drive's normalised innovations."""
    rows = zero_position_rows(problem, drive)
    return r[rows] * problem.drives[drive].readings.std[rows]


def _rms(values: Floats) -> float | None:
    return float(np.sqrt(np.mean(values**2))) if len(values) else None
