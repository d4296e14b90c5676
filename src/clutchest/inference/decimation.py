"""Decimation: a timeline without the events that carry no further information.

A closed clutch says little a hundred times a second: its position at rest moves with temperatures
that take seconds, and while it is locked the tracked speed decides only where the next slip starts.
Nor do samples of inputs, between readings: a straight line from one reading to the next has the
same integral as the bent one, but for what it is off at its two ends.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from clutchest.estimate.timeline import Timeline
from clutchest.inference.noise_model import median_std
from clutchest.models.model import Model
from clutchest.signals import Floats

RESTED = 0.25  # s; readings of a clutch at rest are averaged over this
BENT = 0.05  # s; the same where they turn, as where the disc's expansion meets its cap
TURNS = 5.0  # standard deviations of a change of slope from one such mean to the next
SOON = 0.006  # s; as near to a reading as this, an input has no bend of its own
NEAR = 0.3  # s before and after a regime in which they carry more, all readings stay


def decimated(line: Timeline, model: Model) -> Timeline:
    """The same drive with fewer events; means of readings at rest carry their smaller variance."""
    # some equation beyond heat flow acts
    free = np.full(len(line.t), bool(model.tracked) or not model.regime)
    free |= line.W[line.row].any(axis=1)
    close = _gap(line.t, line.t[free]) <= NEAR
    keep, z, R = close & ~_spare(line), line.z.copy(), line.R.copy()
    keep[[0, -1]] = True
    for i, sensor in enumerate(model.sensors):
        if sensor.mode:  # read in one mode only, where nothing else happens
            of = np.flatnonzero(line.sensor == i)
            keep[of] = False
            middle, mean, variance = _means(line, of)
            keep[middle], z[middle], R[middle] = True, mean, variance
    return replace(
        line,
        t=line.t[keep],
        sensor=line.sensor[keep],
        z=z[keep],
        R=R[keep],
        u=line.u[keep],
        row=line.row[keep],
        mode=line.mode[keep],
        emit=line.emit[keep],
    )


def _spare(line: Timeline) -> NDArray[np.bool_]:
    """Samples (K) of inputs that a reading close by can stand for."""
    reads = line.sensor >= 0
    return ~reads & (_gap(line.t, line.t[reads]) <= SOON)


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
    """For each stretch of at most ``RESTED`` s among the events ``of``, of ``BENT`` s where the
    readings bend: the middle event, the mean reading and its variance."""
    if not len(of):
        return of, np.zeros(0), np.zeros(0)
    t = line.t[of]
    rests = np.concatenate([[0], np.cumsum(np.diff(t) > RESTED)])
    begins = np.concatenate([[True], np.diff(rests) > 0])
    since = t - t[np.flatnonzero(begins)][rests]
    coarse = _stretches(since, rests, RESTED)
    bends = _bends(line, of, coarse, rests)
    stretch = _stretches(np.where(bends, since, np.floor(since / RESTED) * RESTED), rests, BENT)
    mean, variance = _averages(line, of, stretch)
    first = np.searchsorted(stretch, np.arange(len(mean)))
    return of[first + np.bincount(stretch) // 2], mean, variance


def _averages(
    line: Timeline, of: NDArray[np.int64], stretch: NDArray[np.int64]
) -> tuple[Floats, Floats]:
    """The mean of every ``stretch`` of readings, and its variance; R is that of one reading."""
    count = np.bincount(stretch)
    return np.bincount(stretch, line.z[of]) / count, np.bincount(stretch, line.R[of]) / count**2


def _stretches(since: Floats, rests: NDArray[np.int64], length: float) -> NDArray[np.int64]:
    """The number of the stretch of ``length`` s that each reading (k), ``since`` s after its rest
    began, is in."""
    ends = (np.diff(np.floor(since / length)) != 0) | (np.diff(rests) > 0)
    return np.concatenate([[0], np.cumsum(ends)])


def _bends(
    line: Timeline, of: NDArray[np.int64], stretch: NDArray[np.int64], rests: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """Whether each reading (k) lies in a stretch in which readings turn: there, their mean is not
    what the middle one shows."""
    mean, variance = _averages(line, of, stretch)
    of_rest = rests[np.searchsorted(stretch, np.arange(len(mean)))]
    turn, inner = np.zeros(len(mean)), np.flatnonzero(of_rest[2:] == of_rest[:-2]) + 1
    if len(inner):
        second = np.abs(mean[inner - 1] - 2.0 * mean[inner] + mean[inner + 1])
        white = np.sqrt(variance[inner - 1] + 4.0 * variance[inner] + variance[inner + 1])
        turn[inner] = second / np.maximum(white, median_std(second))  # autocorrelated noise: more
    return (turn > TURNS)[stretch]
