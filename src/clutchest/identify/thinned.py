"""A timeline with means where signals run straight.

A hundred readings a second say no more than their means, twenty a second, while every input runs
straight within its noise: the answers to what is unknown are as smooth.  Where signals bend, and
wherever an equation begins or ceases to act, all readings stay.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from clutchest.estimate.timeline import Timeline
from clutchest.identify.condensed import gap
from clutchest.models.model import Model
from clutchest.signals import Floats

BLOCK = 0.05  # s of one mean
FEWEST = 3  # readings worth a mean
STRAIGHT = 4.0  # standard deviations from a straight line that noise explains
NEAR = 0.3  # s before and after a change of regime in which all readings stay


def thinned(
    line: Timeline, model: Model, noise: Mapping[str, float]
) -> tuple[Timeline, NDArray[np.bool_]]:
    """The same drive with one reading of each tracked state per block, and which events are such
    means.  ``noise``: standard deviation of each signal that is mapped."""
    number = np.floor((line.t - line.t[0]) / BLOCK).astype(np.int64)
    begins = np.flatnonzero(np.diff(number, prepend=-1) > 0)
    of = np.cumsum(np.diff(number, prepend=-1) > 0) - 1
    tracked = [i for i, sensor in enumerate(model.sensors) if sensor.name in model.renewed]
    kept = ~np.isin(line.sensor, [-1, *tracked])  # these stay, whatever the others do

    steady = gap(line.t[begins], line.t[1:][np.diff(line.row) != 0]) > NEAR + BLOCK
    steady[[0, -1]] = False
    everything = np.ones(len(of))
    inputs = [_fit(line.t, u, everything, begins, of) for u in line.u.T]
    for item, fit in zip(model.inputs, inputs, strict=True):
        if item.name in noise:
            steady &= fit.unrest <= STRAIGHT * noise[item.name]
    readings = {i: _fit(line.t, line.z, line.sensor == i, begins, of) for i in tracked}
    for i, fit in readings.items():
        level = noise[model.sensors[i].column or model.sensors[i].name]
        steady &= (fit.count >= FEWEST) & (fit.unrest <= STRAIGHT * level)

    t, z, R, u = line.t.copy(), line.z.copy(), line.R.copy(), line.u.copy()
    means = np.zeros(len(of), bool)
    for i, fit in readings.items():
        events = np.flatnonzero((line.sensor == i) & steady[of])
        first = np.searchsorted(of[events], np.flatnonzero(steady))
        middle = events[first + fit.count[steady].astype(int) // 2]
        t[middle], z[middle] = fit.middle[steady], fit.mean[steady]
        R[middle] /= fit.count[steady]
        means[middle] = True
    keep = np.flatnonzero(~steady[of] | kept | means)
    keep = keep[np.argsort(t[keep], kind="stable")]
    inside = keep[steady[of[keep]]]
    for j, fit in enumerate(inputs):
        u[inside, j] = fit.mean[of[inside]] + fit.slope[of[inside]] * (
            t[inside] - fit.middle[of[inside]]
        )
    short = replace(line, t=t[keep], sensor=line.sensor[keep], z=z[keep], R=R[keep], u=u[keep],
                    row=line.row[keep], mode=line.mode[keep], emit=line.emit[keep])  # fmt: skip
    return short, means[keep]


@dataclass(frozen=True, slots=True)
class _Fit:
    """Straight lines through the values in each block (B): ``count`` of them, ``mean`` at the
    ``middle`` of their times, ``slope`` per s; ``unrest`` how far one of them lies off."""

    count: Floats
    middle: Floats
    mean: Floats
    slope: Floats
    unrest: Floats


def _fit(
    t: Floats, value: Floats, where: NDArray, begins: NDArray[np.int64], of: NDArray[np.int64]
) -> _Fit:
    def total(x: Floats) -> Floats:
        return np.asarray(np.add.reduceat(where * x, begins))

    count = total(np.ones(len(t)))
    many = np.maximum(count, 1.0)
    middle, mean = total(t) / many, total(value) / many
    since = t - middle[of]
    slope = total(since * value) / np.maximum(total(since**2), 1e-12)
    off = where * np.abs(value - mean[of] - slope[of] * since)
    return _Fit(count, middle, mean, slope, np.asarray(np.maximum.reduceat(off, begins)))
