"""What fitted numbers are worth on drives that they were not fitted to."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from clutchest.identify.fit import Validation
from clutchest.identify.likelihood import Posterior, along, hold, problem_of
from clutchest.inference.map_fit import Fitter, Look
from clutchest.inference.unknowns import Problem
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
    held = hold(problem, *(("parameter", key) for key in moved))
    theta = np.zeros(len(problem.thetas))
    for i in held:
        theta[i] = moved[problem.thetas[i].key] / problem.thetas[i].unit
    fitter = Fitter(problem)
    new = fitter.settle(theta)
    after_all = _errors(problem, fitter, new)
    theta = new.theta.copy()
    theta[held] = 0.0
    old = fitter.improve(fitter.look(theta), problem.nuisances)  # by the same colour of the noise
    before_all = _errors(problem, fitter, old)
    logs = dict.fromkeys(Path(s).name for drive in holdout.drives for s in drive.sources)
    return Validation(
        tuple(logs),
        before_all[0],
        after_all[0],
        before_all[1],
        after_all[1],
        0.5 * (_cost(fitter, old) - _cost(fitter, new)),
    )


def _cost(fitter: Fitter, look: Look) -> float:
    """−2 ln(probability) up to a constant."""
    look = fitter.again(look)
    return float(look.r @ look.r + np.sum(fitter.prior * look.theta**2))


def _errors(problem: Problem, fitter: Fitter, look: Look) -> tuple[float | None, float | None]:
    """Root mean square errors of torque and zero position at a look."""
    at = Posterior(problem, fitter, look, look.theta, np.zeros((0, 0)))
    problem.linearise(look.theta, look.shapes, np.zeros(0, np.int64))  # the drives stand there
    torque, position = [], []
    for i in range(len(problem.drives)):
        _, (measured, modelled) = along(at, i, ("measured_torque", "clutch_torque"))
        torque.append(modelled - measured)
        position.append(zero_position_errors(problem, i, look.raw[i].r))
    return _rms(np.concatenate(torque)), _rms(np.concatenate(position))


def zero_position_rows(problem: Problem, drive: int) -> NDArray[np.intp]:
    """Which of a drive's readings are of the zero position."""
    model: Model = problem.compiled.model
    return np.flatnonzero(problem.drives[drive].sensor == model.sensor("zero_position"))


def zero_position_errors(problem: Problem, drive: int, r: Floats) -> Floats:
    """Measured less modelled zero position (k,), mm, from a drive's normalised innovations."""
    rows = zero_position_rows(problem, drive)
    return r[rows] * problem.drives[drive].std[rows]


def _rms(values: Floats) -> float | None:
    return float(np.sqrt(np.mean(values**2))) if len(values) else None
