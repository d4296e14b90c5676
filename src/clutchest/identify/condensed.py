"""A timeline with the events that tell nothing new left out.

A closed clutch says little a hundred times a second: its position at rest moves with temperatures
that take seconds, and while it is locked the engine's speed tells only where the next slip starts.
Nor do the inputs of an open one, between readings.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from clutchest.estimate.timeline import Timeline
from clutchest.models.model import Model
from clutchest.signals import Floats

RESTED = 1.0  # s; readings of a clutch at rest are averaged over this
SOON = 0.006  # s; as near to a reading as this, an input of an open clutch has no bend of its own
NEAR = 0.3  # s before and after a regime in which they tell more, all readings stay


def condensed(line: Timeline, model: Model) -> Timeline:
    """The same drive with fewer events; means of readings at rest carry their smaller variance."""
    free = line.W[line.row].any(axis=1)  # some equation beyond heat flow acts
    close = _gap(line.t, line.t[free]) <= NEAR
    keep, z, R = close & ~_spare(line, model), line.z.copy(), line.R.copy()
    keep[[0, -1]] = True
    for i, sensor in enumerate(model.sensors):
        if sensor.mode:  # read in one mode only, where nothing else happens
            of = np.flatnonzero(line.sensor == i)
            keep[of] = False
            middle, mean, variance = _means(line, of)
            keep[middle], z[middle], R[middle] = True, mean, variance
    return replace(line, t=line.t[keep], sensor=line.sensor[keep], z=z[keep], R=R[keep],
                   u=line.u[keep], row=line.row[keep], mode=line.mode[keep],
                   emit=line.emit[keep])  # fmt: skip


def _spare(line: Timeline, model: Model) -> NDArray[np.bool_]:
    """Samples (K) of inputs, of a clutch that passes no torque, that a reading close by can stand
    for: what they tell there passes slowly."""
    reads = line.sensor >= 0
    if "engaged" not in model.regime:  # a clutch that always drags
        return np.zeros(len(line.t), bool)
    grips = line.W[line.row, model.regime.index("engaged")] > 0.0
    apart = _gap(line.t, line.t[grips]) > NEAR
    return ~reads & apart & (_gap(line.t, line.t[reads]) <= SOON)


def _gap(t: Floats, others: Floats) -> Floats:
    """From each of ``t`` (K), s, to the nearest of ``others``; both in order."""
    if not len(others):
        return np.full(len(t), np.inf)
    after = np.clip(np.searchsorted(others, t), 0, len(others) - 1)
    before = np.maximum(after - 1, 0)
    return np.minimum(np.abs(others[after] - t), np.abs(t - others[before]))


def _means(
    line: Timeline, of: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """For each stretch of at most ``RESTED`` s among the events ``of``: the middle event, the mean
    reading and its variance."""
    if not len(of):
        return of, np.zeros(0), np.zeros(0)
    t = line.t[of]
    rests = np.concatenate([[0], np.cumsum(np.diff(t) > RESTED)])
    begins = np.concatenate([[True], np.diff(rests) > 0])
    since = t - t[np.flatnonzero(begins)][rests]
    stretch = np.concatenate([[0], np.cumsum((np.diff(np.floor(since / RESTED)) != 0)
                                             | (np.diff(rests) > 0))])  # fmt: skip
    count = np.bincount(stretch)
    first = np.searchsorted(stretch, np.arange(len(count)))
    mean = np.bincount(stretch, line.z[of]) / count
    # R is the variance of one reading, the same for all of a sensor
    return of[first + count // 2], mean, np.bincount(stretch, line.R[of]) / count**2
