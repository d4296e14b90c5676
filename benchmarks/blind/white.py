"""Readings made white by the noise that a drive's sensors are stated to have.

The engine's speed follows from the reported torque and the measured position, whose noise it
integrates; its own readings have noise of their own.  That is a linear system of four states, and
the innovations of its Kalman filter are white.  A straight consequence of how noise is drawn:
nothing of what estimates or discovers is used.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit

from clutchest.signals import Floats

UNKNOWN = 1e3  # rad/s, of the speed that a stretch begins with: nothing is known of it


@dataclass(frozen=True)
class SensorNoise:
    """Standard deviation and AR(1) coefficient per reading."""

    std: float
    ar: float

    def of_mean(self, count: int) -> float:
        """Standard deviation of the mean of so many neighbouring readings."""
        lags = np.arange(1, count)
        return self.std * float(
            np.sqrt((1 + 2 * np.sum((1 - lags / count) * self.ar**lags)) / count)
        )

    @property
    def of_sum(self) -> float:
        """Standard deviation of the sum of many readings, over the root of their number."""
        return self.std * float(np.sqrt((1.0 + self.ar) / (1.0 - self.ar)))


@dataclass(frozen=True)
class SpeedFilter:
    """A stretch of speed readings: ``gain`` (n, 4) and ``spread`` (n,) of its Kalman filter,
    ``move`` (n, 2), what a unit of the noise of torque and of position does to the speed until a
    reading, and the AR(1) coefficients ``keep`` (3,)."""

    gain: Floats
    spread: Floats
    move: Floats
    keep: Floats

    @classmethod
    def of(
        cls, slope: Floats, inertia: float, step: float, noise: Sequence[SensorNoise]
    ) -> SpeedFilter:
        """Of readings every ``step`` s, the speed at whose first is unknown; ``slope`` (n,) of the
        clutch torque over the position in Nm/mm; ``noise`` of the speed, the torque and the
        position, ``inertia`` of the engine in kg m²."""
        std, keep = (np.array([getattr(one, what) for one in noise]) for what in ("std", "ar"))
        n = len(slope)
        gain, spread, move = np.empty((n, 4)), np.empty(n), np.empty((n, 2))
        _design(slope, 0.5 * step / inertia, std, keep, gain, spread, move)
        return cls(gain, spread, move, keep)

    def innovations(self, rows: Floats) -> Floats:
        """In standard deviations, (n − 1, m), of columns ``rows`` (n, m) in rad/s."""
        out = np.empty_like(rows)
        _filter(rows, self.gain, self.spread, self.move, self.keep, out)
        return out[1:]


@njit(cache=True, error_model="numpy")
def _design(
    slope: Floats,
    per_torque: float,
    std: Floats,
    keep: Floats,
    gain: Floats,
    spread: Floats,
    move: Floats,
) -> None:
    """States: what the speed is off by, and the noises of speed, torque and position."""
    p, moved, seen = np.zeros((4, 4)), np.zeros((4, 4)), np.zeros(4)
    step, fresh = np.zeros((4, 4)), np.zeros((4, 3))
    p[0, 0], step[0, 0] = UNKNOWN**2, 1.0
    for i in range(3):
        p[i + 1, i + 1] = std[i] ** 2
        step[i + 1, i + 1] = keep[i]
        fresh[i + 1, i] = std[i] * np.sqrt(1.0 - keep[i] ** 2)
    for k in range(len(slope)):
        # both inputs are linear between two readings: half of each one's noise acts
        before = slope[k - 1] if k > 0 else 0.0
        move[k, 0] = per_torque * (1.0 + keep[1])
        move[k, 1] = per_torque * (before + slope[k] * keep[2])
        if k > 0:
            step[0, 2], step[0, 3] = move[k, 0], move[k, 1]
            fresh[0, 1], fresh[0, 2] = per_torque * fresh[2, 1], per_torque * slope[k] * fresh[3, 2]
            _multiply(step, p, moved)
            _multiply(moved, step.T, p)
            _multiply(fresh, fresh.T, moved)
            p += moved
        for i in range(4):
            seen[i] = p[i, 0] + p[i, 1]
        variance = seen[0] + seen[1]
        spread[k] = np.sqrt(variance)
        for i in range(4):
            gain[k, i] = seen[i] / variance
            for j in range(4):
                p[i, j] -= seen[i] * seen[j] / variance


@njit(cache=True, error_model="numpy")
def _multiply(a: Floats, b: Floats, out: Floats) -> None:
    """``out`` = a b, of a few rows."""
    for i in range(a.shape[0]):
        for j in range(b.shape[1]):
            out[i, j] = 0.0
            for k in range(a.shape[1]):
                out[i, j] += a[i, k] * b[k, j]


@njit(cache=True, error_model="numpy")
def _filter(
    rows: Floats, gain: Floats, spread: Floats, move: Floats, keep: Floats, out: Floats
) -> None:
    for j in range(rows.shape[1]):
        speed = own = torque = place = 0.0
        for k in range(len(rows)):
            if k > 0:
                speed += move[k, 0] * torque + move[k, 1] * place
                own, torque, place = keep[0] * own, keep[1] * torque, keep[2] * place
            innovation = rows[k, j] - speed - own
            out[k, j] = innovation / spread[k]
            speed += gain[k, 0] * innovation
            own += gain[k, 1] * innovation
            torque += gain[k, 2] * innovation
            place += gain[k, 3] * innovation
