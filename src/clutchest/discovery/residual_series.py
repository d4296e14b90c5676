"""Residuals of every sensor in order of time, at the sample rate of the log."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clutchest.inference.noise_model import Stretches
from clutchest.inference.prepared_drive import PreparedDrive
from clutchest.inference.problem import NormalisedInnovations, Problem
from clutchest.signals import Floats

SAME = 1e-9  # of all readings' range: what differs by less is the same reading


@dataclass(frozen=True, slots=True)
class ResidualSeries:
    """Residuals (n) of one ``sensor`` in all drives, one drive after the other.

    ``value`` (n) in standard deviations that white noise as stated would give them, the median of
    which is ``std`` in ``unit``;
    ``mode`` (n) its place among the machine's modes; ``place`` (n) the number of residuals before
    it in its interval, of one mode and without gaps; ``period`` s from one to the next;
    ``rounding``: the variance of what the readings' steps round off, over that of their noise.
    """

    sensor: str
    unit: str
    value: Floats
    std: float
    mode: NDArray
    place: NDArray[np.int64]
    period: float
    rounding: float = 0.0

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
            t, value, std, mode, place = joined
            following = np.diff(t)[place[1:] > 0]
            period = float(np.median(following)) if len(following) else np.inf
            series.append(
                ResidualSeries(
                    sensor.name,
                    sensor.unit,
                    value,
                    float(np.median(std)),
                    mode,
                    place.astype(np.int64),
                    period,
                    (_step(problem.drives, index) / np.median(std)) ** 2 / 12.0,
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


def _of_drive(drive: PreparedDrive, r: Floats, sensor: int) -> tuple[NDArray, ...] | None:
    """Times, residuals, their standard deviations, modes and places of one sensor in one drive;
    None where it has none."""
    readings = drive.readings
    rows = np.flatnonzero(readings.sensor == sensor)
    if not len(rows):
        return None
    t, mode, innovation = readings.t[rows], readings.mode[rows], r[rows] * readings.std[rows]
    noise = drive.line.R[readings.event[rows]]
    # what white noise makes of innovations at a steady gain, which is larger where power is
    std = np.sqrt(2.0 * noise / (1.0 + noise / readings.std[rows] ** 2))
    value = innovation / std
    place = _places(t, mode)
    if sensor in drive.unaveraged:
        every = drive.unaveraged[sensor]
        predicted = drive.line.z[readings.event[rows]] - innovation
        after = np.clip(np.searchsorted(t, every.t), 0, len(t) - 1)
        between = (place[after] > 0) & (every.t >= t[after - 1]) & (every.t <= t[after])
        at, std = every.t[between], every.std[between]
        value = (every.z[between] - np.interp(at, t, predicted)) / std
        t, mode = at, mode[after[between]]
        place = _places(t, mode)
    return (t, value, std, mode, place) if len(t) else None


def _places(t: Floats, mode: NDArray) -> NDArray[np.int64]:
    return Stretches.of(t, np.zeros(len(t), np.int64), mode.astype(np.int64)).place
