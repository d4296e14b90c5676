"""The online filter: filterpy's extended Kalman filter, with the clutch's equations in it.

It is also the reference that the compiled whole-log kernel must agree with: it calls the same
model functions, but integrates, propagates and updates by itself and by filterpy.
"""

from __future__ import annotations

from math import ceil
from types import ModuleType

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter

from clutchest.estimate.timeline import Timeline
from clutchest.signals import Floats


class OnlineFilter(ExtendedKalmanFilter):
    """filterpy's filter over the states of a model; its public attributes keep their meaning.

    ``x`` (n), ``P`` (n, n): start; ``functions``: the lowered model (``compute.build.load``);
    ``p``, ``g``: parameters and numbers of the effects; ``timeline`` gives noise and regimes;
    ``limit``: innovations beyond so many standard deviations count for less.
    """

    def __init__(
        self,
        functions: ModuleType,
        x: Floats,
        P: Floats,
        p: Floats,
        g: Floats,
        timeline: Timeline,
        limit: float,
    ) -> None:
        super().__init__(dim_x=len(x), dim_z=1)
        self.x, self.P = np.array(x), np.array(P)
        self.functions, self.p, self.g = functions, p, g
        self.timeline, self.limit = timeline, limit

    def rates(self, x: Floats, u: Floats, row: int) -> tuple[Floats, Floats, Floats]:
        """dx/dt (n) with its derivatives by x (n, n) and by u (n, nu)."""
        n, nu = len(x), len(u)
        f, A, B = np.zeros(n), np.zeros((n, n)), np.zeros((n, nu))
        self.functions.dynamics(x, u, self.timeline.W[row], self.p, self.g, f, A, B)
        return f, A, B

    def mapped(self, x: Floats, u0: Floats, u1: Floats) -> tuple[Floats, Floats]:
        """The state after the step map, and its derivative (n, n)."""
        if not self.functions.HAS_MAP:
            return x, np.eye(len(x))
        n = len(x)
        new, J = np.zeros(n), np.zeros((n, n))
        self.functions.step_map(x, u0, u1, self.p, self.g, new, J)
        return new, J

    def predict_x(self, u: tuple[float, Floats, Floats, int] | int = 0) -> None:
        """Heun's rule over ``u`` = (dt s, inputs at start, inputs at end, regime row).

        Sets ``F`` and ``Q`` for filterpy's own propagation of P.
        """
        assert isinstance(u, tuple)
        dt, u0, u1, row = u
        one = np.eye(self.dim_x)
        f0, A0, B0 = self.rates(self.x, u0, row)
        guess, J0 = self.mapped(self.x + dt * f0, u0, u1)
        f1, A1, B1 = self.rates(guess, u1, row)
        self.x, J1 = self.mapped(self.x + dt / 2 * (f0 + f1), u0, u1)
        self.F = J1 @ (one + dt / 2 * (A0 + A1 @ J0 @ (one + dt * A0)))
        of_inputs = (B0 * self.timeline.noise) @ B0.T + (B1 * self.timeline.noise) @ B1.T
        self.Q = dt * np.diag(self.timeline.Q[row]) + dt / 2 * of_inputs

    def advance(self, span: float, u0: Floats, u1: Floats, row: int) -> None:
        """Predict over ``span`` s, in steps no longer than the regime allows."""
        steps = ceil(span / self.timeline.longest[row])
        slope = (u1 - u0) / steps
        for step in range(steps):
            ua, ub = u0 + step * slope, u0 + (step + 1) * slope
            self.predict((span / steps, ua, ub, row))

    def correct(self, sensor: int, z: float, R: float, u: Floats, row: int) -> tuple[float, float]:
        """Take one reading; returns innovation and its predicted variance."""
        H, w = np.zeros(self.dim_x), self.timeline.W[row]
        h = self.functions.reading(sensor, self.x, u, w, self.p, self.g, H)
        S = H @ self.P @ H + R
        used = max(S, (z - h) ** 2 / self.limit**2)
        self.update(
            np.array([z]),
            HJacobian=lambda x: H[None, :],
            Hx=lambda x: np.array([h]),
            R=R + (used - S),
        )
        return float(z - h), float(S)

    def run(self) -> tuple[Floats, Floats, float]:
        """Filter the whole timeline: states (K, n), covariances (K, n, n), log-likelihood."""
        line = self.timeline
        xs, Ps = np.empty((len(line.t), self.dim_x)), np.empty((len(line.t), *self.P.shape))
        total = 0.0
        for k in range(len(line.t)):
            if k and line.t[k] > line.t[k - 1]:
                self.advance(line.t[k] - line.t[k - 1], line.u[k - 1], line.u[k], line.row[k])
            if line.sensor[k] >= 0:
                self.correct(line.sensor[k], line.z[k], line.R[k], line.u[k], line.row[k])
                total += float(self.log_likelihood)
            xs[k], Ps[k] = self.x, self.P
        return xs, Ps, total
