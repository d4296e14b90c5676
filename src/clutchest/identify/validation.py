"""What fitted numbers are worth on drives that they were not fitted to."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from clutchest.identify.fit import ErrorChange, Validation
from clutchest.identify.likelihood import Posterior, along, problem_of
from clutchest.inference.map_fit import improve, settle
from clutchest.inference.objective import Objective
from clutchest.inference.problem import Problem
from clutchest.inference.white_linearisation import Linearisation
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
        _compared(before, before_all, after_all),
        0.5 * (_cost(objective, old) - _cost(objective, new)),
    )


def _compared(
    vehicle: Vehicle, before: dict[str, float | None], after: dict[str, float | None]
) -> tuple[ErrorChange, ...]:
    """What changed, with words and units of the machine."""
    machine = vehicle.machine
    named = {s.name: (s.name.replace("_", " "), s.unit) for s in machine.sensors}
    if pair := machine.compared:
        named[pair.key] = pair.what, pair.unit
    return tuple(ErrorChange(name, *named[name], before[name], after[name]) for name in before)


def _cost(objective: Objective, fit: Linearisation) -> float:
    """−2 ln(probability) up to a constant."""
    fit = objective.whitened(fit)
    return float(fit.r @ fit.r + np.sum(objective.prior * fit.theta**2))


def _errors(objective: Objective, fit: Linearisation) -> dict[str, float | None]:
    """Root mean square errors at a fit: of the machine's compared pair, by its key, and of the
    readings of every sensor whose state is not renewed by them, by its name."""
    problem = objective.problem
    machine, drives = problem.vehicle.machine, range(len(problem.drives))
    errors = {}
    if pair := machine.compared:
        at = Posterior(objective, fit, np.zeros((0, 0)))
        both = [along(at, i, (pair.measured, pair.simulated))[1] for i in drives]
        errors[pair.key] = _rms(np.concatenate([modelled - read for read, modelled in both]))
    model = problem.compiled.model
    known = [sensor.name for sensor in model.sensors]
    for name in (s.name for s in machine.sensors if s.name not in model.followed):
        read = [reading_errors(problem, i, name, fit.raw[i].r) for i in drives if name in known]
        errors[name] = _rms(np.concatenate([np.zeros(0), *read]))
    return errors


def rows_of(problem: Problem, drive: int, sensor: str) -> NDArray[np.intp]:
    """Which of a drive's readings are of one sensor."""
    which = problem.compiled.model.sensor(sensor)
    return np.flatnonzero(problem.drives[drive].readings.sensor == which)


def reading_errors(problem: Problem, drive: int, sensor: str, r: Floats) -> Floats:
    """Measured less modelled readings (k,) of one sensor, in its unit, from a drive's normalised
    innovations."""
    rows = rows_of(problem, drive, sensor)
    return r[rows] * problem.drives[drive].readings.std[rows]


def _rms(values: Floats) -> float | None:
    return float(np.sqrt(np.mean(values**2))) if len(values) else None
