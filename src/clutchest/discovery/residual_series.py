"""Residuals of every sensor in order of time, at the sample rate of the log."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clutchest.inference.innovations import NormalisedInnovations
from clutchest.inference.noise_model import Stretches
from clutchest.inference.prepared_drive import PreparedDrive
from clutchest.inference.problem import Problem
from clutchest.signals import Floats

SAME = 1e-9  # of all readings' range: what differs by less is the same reading


@dataclass(frozen=True, slots=True)
class ResidualSeries:
    """Residuals (n) of one ``sensor`` in all drives, one drive after the other.

    ``value`` (n) in standard deviations that white noise as stated would give them, with as much of
    the process noise of states that readings correct as fits best, the median of which is ``std``
    in ``unit``;
    ``mode`` (n) its place among the machine's modes; ``place`` (n) the number of residuals before
    it in its interval, of one mode and without gaps; ``period`` s from one to the next;
    ``rounding``: the variance of what the readings' steps round off, over that of their noise;
    ``followed``: whether readings correct the states that predict them, as in a filter.
    """

    sensor: str
    unit: str
    value: Floats
    std: float
    mode: NDArray
    place: NDArray[np.int64]
    period: float
    rounding: float = 0.0
    followed: bool = False

    def of_mode(self, mode: int) -> tuple[Floats, NDArray[np.int64]]:
        """Values and places of the residuals in one mode."""
        rows = self.mode == mode
        return self.value[rows], self.place[rows]


def residual_series(problem: Problem, raw: Sequence[NormalisedInnovations]) -> list[ResidualSeries]:
    """One per sensor, of a linearisation of every drive as the problem gives it.

    Where decimation averages readings, all of them, less what the averages were predicted to be.
    """
    series = []
    for index, sensor in enumerate(problem.compiled.model.sensors):
        parts = [
            part
            for drive, innovations in zip(problem.drives, raw, strict=True)
            if (part := _of_drive(drive, innovations.r, index)) is not None
        ]
        if parts:
            joined = [np.concatenate(columns) for columns in zip(*parts, strict=True)]
            t, innovation, white, predicted, mode, place = joined
            std = np.sqrt(likeliest_variance(innovation, white, predicted))
            following = np.diff(t)[place[1:] > 0]
            period = float(np.median(following)) if len(following) else np.inf
            series.append(
                ResidualSeries(
                    sensor.name,
                    sensor.unit,
                    innovation / std,
                    float(np.median(std)),
                    mode,
                    place.astype(np.int64),
                    period,
                    (_step(problem.drives, index) / np.median(std)) ** 2 / 12.0,
                    any(_corrects(drive, index) for drive in problem.drives),
                )
            )
    return series


def _step(drives: Sequence[PreparedDrive], sensor: int) -> float:
    """The smallest difference between readings of a sensor, in its unit."""
    every = [
        drive.unaveraged[sensor].z
        if sensor in drive.unaveraged
        else drive.line.z[drive.readings.event[drive.readings.sensor == sensor]]
        for drive in drives
    ]
    apart = np.diff(np.unique(np.concatenate(every)))
    apart = apart[apart > SAME * np.ptp(np.concatenate(every))]
    return float(apart.min()) if len(apart) else 0.0


def _corrects(drive: PreparedDrive, sensor: int) -> bool:
    """Whether readings of a sensor correct tracked states."""
    return bool(drive.gains.gain[drive.readings.event[drive.readings.sensor == sensor]].any())


def _of_drive(drive: PreparedDrive, r: Floats, sensor: int) -> tuple[NDArray, ...] | None:
    """Times, residuals, their variances by white noise alone and as the filter predicts them, modes
    and places of one sensor in one drive; None where it has none."""
    readings = drive.readings
    rows = np.flatnonzero(readings.sensor == sensor)
    if not len(rows):
        return None
    t, mode, innovation = readings.t[rows], readings.mode[rows], r[rows] * readings.std[rows]
    noise, predicted = drive.line.R[readings.event[rows]], readings.std[rows] ** 2
    # what white noise makes of innovations at a steady gain, which is larger where power is
    white = 2.0 * noise / (1.0 + noise / predicted)
    place = _places(t, mode)
    if sensor in drive.unaveraged:
        every = drive.unaveraged[sensor]
        level = drive.line.z[readings.event[rows]] - innovation
        after = np.clip(np.searchsorted(t, every.t), 0, len(t) - 1)
        between = (place[after] > 0) & (every.t >= t[after - 1]) & (every.t <= t[after])
        at = every.t[between]
        innovation = every.z[between] - np.interp(at, t, level)
        white = predicted = every.std[between] ** 2
        t, mode = at, mode[after[between]]
        place = _places(t, mode)
    return (t, innovation, white, predicted, mode, place) if len(t) else None


def likeliest_variance(innovation: Floats, white: Floats, predicted: Floats) -> Floats:
    """Variances (n) of innovations (n) between those by white noise alone and those that the filter
    predicts, up to a factor: how much of its process noise there is, is not known beforehand."""

    def cost(share: float) -> float:
        variance = white + share * (predicted - white)
        return float(np.log(np.mean(innovation**2 / variance)) + np.mean(np.log(variance)))

    if np.allclose(white, predicted) or not innovation.any():
        return white
    from scipy.optimize import minimize_scalar  # takes a tenth of a second, and is asked for last

    share = minimize_scalar(cost, bounds=(0.0, 1.0), method="bounded").x
    return np.asarray(white + share * (predicted - white))


def _places(t: Floats, mode: NDArray) -> NDArray[np.int64]:
    return Stretches.of(t, np.zeros(len(t), np.int64), mode.astype(np.int64)).place
