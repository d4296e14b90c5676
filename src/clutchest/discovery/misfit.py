"""Residuals of the model: their level, and their means over the covariates."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from clutchest.discovery.residuals import Bins, Level, Misfit
from clutchest.discovery.torque import torques
from clutchest.inference.covariates import covariates
from clutchest.inference.objective import Objective
from clutchest.inference.white_linearisation import Linearisation
from clutchest.signals import Floats

BINS = 8
FEWEST = 40  # readings in a mode that are worth a picture


def misfit(objective: Objective, before: Linearisation, after: Linearisation) -> Misfit:
    """Residuals of the original model over every covariate, and those of the extended one."""
    problem = objective.problem
    sensors = tuple(sensor.name for sensor in problem.compiled.model.sensors)
    modes = problem.compiled.machine.regimes.modes
    simulated = torques(problem, before)
    values = [covariates(*each) for each in zip(problem.drives, before.implied, strict=True)]
    bins: list[Bins] = []
    levels: list[Level] = []
    white = objective.whitened(before).r
    mended = white if after is before else objective.whitened(after).r
    sensor = np.concatenate([d.readings.sensor for d in problem.drives])
    mode = np.concatenate([d.readings.mode for d in problem.drives])
    for s, name in enumerate(sensors):
        for m in np.unique(mode[sensor == s]):
            rows = np.flatnonzero((sensor == s) & (mode == m))
            if len(rows) < FEWEST:
                continue
            r = white[rows]
            level, lag = float(np.mean(r**2)), float(np.mean(r[1:] * r[:-1]))
            levels.append(Level(name, modes[m], level, lag / level, len(r)))
            for covariate in [name for name in values[0] if all(name in v for v in values)]:
                joined = np.concatenate(
                    [
                        v[covariate][d.readings.event]
                        for v, d in zip(values, problem.drives, strict=True)
                    ]
                )[rows]
                edges = np.unique(np.quantile(joined, np.linspace(0.0, 1.0, BINS + 1)))
                if len(edges) < 3:
                    continue
                of = np.clip(np.searchsorted(edges, joined, side="right") - 1, 0, len(edges) - 2)
                count = np.bincount(of, minlength=len(edges) - 1)
                means = (*_means(r, of, count), count, *_means(mended[rows], of, count))
                bins.append(Bins(name, modes[m], covariate, edges, *means))
    extended = simulated if after is before else torques(problem, after)
    return Misfit(
        sensors,
        tuple(d.readings.t for d in problem.drives),
        tuple(d.readings.sensor for d in problem.drives),
        tuple(rows.r for rows in before.raw),
        tuple(rows.r for rows in after.raw),
        tuple((*old, new) for old, (_, _, new) in zip(simulated, extended, strict=True)),
        tuple(bins),
        tuple(levels),
    )


def _means(r: Floats, of: NDArray, count: NDArray) -> tuple[Floats, Floats]:
    """Mean of ``r`` (n) in every bin and its standard error (b), ``of`` (n) the bin of each."""
    safe = np.maximum(count, 1)
    mean = np.bincount(of, r, minlength=len(count)) / safe
    square = np.bincount(of, r**2, minlength=len(count)) / safe
    return mean, np.sqrt(np.maximum(square - mean**2, 0.0) / safe)
