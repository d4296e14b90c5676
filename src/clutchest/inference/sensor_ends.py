"""Readings near the end of a sensor's range, where noise decides which of them there are.

A reading beyond the vehicle file's min … max is none.  Where the equations have a quantity within
its noise of such an end, only readings that noise has moved away from it are left: their errors
have a mean, which passes for an error of the equations.  So no reading counts where the prediction
lies that near: what decides is the prediction, which knows nothing of the reading's own noise.  As
the noise may be slow, the readings before do not tell that a single one is safe; its deviation is
that of the whole error.  Likewise where the equations end, as those of an engine that has stalled.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from clutchest import units
from clutchest.inference.map_fit import fitted, settle
from clutchest.inference.objective import Objective
from clutchest.inference.problem import Problem
from clutchest.inference.white_linearisation import Linearisation
from clutchest.models.symbols import Sensor
from clutchest.signals import Floats
from clutchest.vehicle import Vehicle

# Standard deviations: of readings that far from an end, 2 % are lost, and the mean of the others is
# off by 0.05 of one; of all beyond, by too little to be seen.
REACH = 2.0
TURNS = 3  # of a fit and of what counts by it, at most

Rows = NDArray[np.bool_]
FitOf = Callable[[Problem, Floats], tuple[Objective, Linearisation]]


def settled_off_ends(problem: Problem) -> tuple[Objective, Linearisation]:
    """The most probable nuisances, as :func:`~clutchest.inference.map_fit.settle` has them, of the
    readings that count by them; of all where none would."""

    def settled(part: Problem, theta: Floats) -> tuple[Objective, Linearisation]:
        return settle(Objective.of(part), theta, fitted=bool(theta.any()))

    return _off_ends(problem, problem.begin, settled)


def off_ends(problem: Problem, theta: Floats) -> Problem:
    """The same with the readings that count by the most probable nuisances from ``theta`` (m) on,
    in noise as it is stated, where its fits begin then."""

    def near(part: Problem, theta: Floats) -> tuple[Objective, Linearisation]:
        objective = Objective.of(part)
        return objective, fitted(objective, theta)

    objective, fit = _off_ends(problem, theta, near)
    return replace(objective.problem, begin=fit.theta)


def _off_ends(problem: Problem, theta: Floats, fit_of: FitOf) -> tuple[Objective, Linearisation]:
    """A fit from ``theta`` on, and others until the readings count that do by it."""
    objective, fit = fit_of(problem, theta)
    ends = [_ends(sensor, problem.vehicle) for sensor in problem.compiled.model.sensors]
    if not np.isfinite(ends).any():
        return objective, fit
    counted = [np.ones(len(drive.readings.t), bool) for drive in problem.drives]
    for _ in range(TURNS):
        count = _off(problem, fit.theta, counted, np.array(ends))
        same = all(np.array_equal(*each) for each in zip(count, counted, strict=True))
        if same or not any(map(np.any, count)):
            break
        counted = count
        objective, fit = fit_of(problem.counting(counted), fit.theta)
    return objective, fit


def _off(problem: Problem, theta: Floats, counted: Sequence[Rows], ends: Floats) -> list[Rows]:
    """Of the readings (K) of each drive those which the equations have at ``theta`` (m) further
    from the ``ends`` (sensors, 2) than errors of what ``counted`` until now reach."""
    raw = problem.linearise(theta, {}, np.zeros(0, np.int64))
    errors = [each.r * drive.readings.std for each, drive in zip(raw, problem.drives, strict=True)]
    sensors = [drive.readings.sensor for drive in problem.drives]
    own, of = (
        np.concatenate([each[rows] for each, rows in zip(parts, counted, strict=True)])
        for parts in (errors, sensors)
    )
    squares = np.bincount(of, own**2, len(ends)) / np.maximum(np.bincount(of, None, len(ends)), 1)
    low, high = ends.T + REACH * np.sqrt(squares) * np.array([[1.0], [-1.0]])
    off = []
    for drive, error, which in zip(problem.drives, errors, sensors, strict=True):
        predicted = drive.line.z[drive.readings.event] - error
        off.append((predicted > low[which]) & (predicted < high[which]))
    return off


def _ends(sensor: Sensor, vehicle: Vehicle) -> tuple[float, float]:
    """Between what, in the sensor's unit, readings are used and equations hold; a signal made of
    several has no range of its own."""
    how = vehicle.signals.get(sensor.column or sensor.name)
    if how is None or how.less or not units.compatible(how.bus.unit, sensor.unit):
        return sensor.least, np.inf
    low = -np.inf if how.minimum is None else how.minimum
    high = np.inf if how.maximum is None else how.maximum
    ends = units.convert_reading(np.array([low, high]), how.bus.unit, sensor.unit)
    return max(float(ends[0]), sensor.least), float(ends[1])
