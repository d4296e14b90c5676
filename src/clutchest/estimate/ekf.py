"""filterpy's extended Kalman filter with a machine's equations in it.

It is also the reference that the compiled whole-log kernel must agree with: it calls the same
model functions, but integrates, propagates and updates by itself and by filterpy.
"""

from __future__ import annotations

from math import ceil, factorial

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter

from clutchest.compute.records import Belief
from clutchest.compute.step import SMALL, TERMS
from clutchest.estimate.timeline import Timeline
from clutchest.estimate.whole_log import (
    ROBUST_LIMIT,
    Compiled,
)
from clutchest.signals import Floats


class OnlineFilter(ExtendedKalmanFilter):
    """filterpy's filter over the states of a model; its public attributes keep their meaning.

    ``start`` as the whole-log filter takes it; ``timeline`` gives noise and regimes; innovations
    beyond ``limit`` standard deviations count for less.

    With ``consider`` the slip energy (J) and the uncertain parameters follow the states in ``x``
    and ``P``, as numbers that no measurement corrects (Schmidt's consider filter): ``x``
    (n + 1 + m), ``P`` (n + 1 + m, n + 1 + m), the parameters as deviations from their values.
    """

    def __init__(
        self,
        compiled: Compiled,
        start: Belief,
        timeline: Timeline,
        *,
        consider: bool = False,
        limit: float = ROBUST_LIMIT,
    ) -> None:
        self.states, self.consider = len(start.x), consider
        size = self.states + (1 + len(compiled.thetas) if consider else 0)
        super().__init__(dim_x=size, dim_z=1)
        self.compiled, self.timeline, self.limit = compiled, timeline, limit
        self.functions, self.p, self.g = compiled.functions, compiled.p, compiled.g
        self.x, self.P = np.array(start.x), np.array(start.P)
        if consider:
            self.x, self.P = _with_constants(start, compiled.spread)
        self.doubts = np.sqrt(np.diag(start.P)[self.functions.DOUBTED])
        if len(self.doubts) and start.held[0] >= 0.0:  # as the last reading left them
            self.doubts = start.held[: len(self.doubts)].copy()

    @property
    def names(self) -> tuple[str, ...]:
        """What ``x`` holds, one after the other; a parameter of an effect as ``effect.number``."""
        states = tuple(state.name for state in self.compiled.model.states)
        if not self.consider:
            return states
        thetas = (
            key if owner == "parameter" else f"{owner}.{key}" for owner, key in self.compiled.thetas
        )
        return (*states, "slip_energy", *thetas)

    def holding(self, row: int) -> Floats:
        """What holds now: regime flags, and standard deviations that equations may use."""
        w = self.timeline.W[row].copy()
        w[len(w) - len(self.doubts) :] = self.doubts
        return w

    def rates(self, x: Floats, u: Floats, row: int) -> tuple[Floats, Floats, Floats]:
        """dx/dt (n) with its derivatives by x (n, n) and by u (n, nu)."""
        n, nu = len(x), len(u)
        f, A, B = np.zeros(n), np.zeros((n, n)), np.zeros((n, nu))
        self.functions.dynamics(x, u, self.holding(row), self.p, self.g, f, A, B)
        return f, A, B

    def power(self, x: Floats, u: Floats, row: int) -> tuple[float, Floats]:
        """Slip power in W, the model's last output, and its derivative (n) by x."""
        y, Y, _ = self.outputs(x, u, row)
        return float(y[-1]), Y[-1]

    def outputs(self, x: Floats, u: Floats, row: int) -> tuple[Floats, Floats, Floats]:
        """The model's outputs with their derivatives by x and by u."""
        f = self.functions
        y, Y, Yu = np.zeros(f.OUTPUTS), np.zeros((f.OUTPUTS, len(x))), np.zeros((f.OUTPUTS, len(u)))
        f.outputs(x, u, self.holding(row), self.p, self.g, y, Y, Yu)
        return y, Y, Yu

    def mapped(self, x: Floats, u0: Floats, u1: Floats, row: int) -> tuple[Floats, Floats]:
        """The state after the step map, and its derivative (n, n)."""
        if not self.functions.HAS_MAP:
            return x, np.eye(len(x))
        n = len(x)
        new, J = np.zeros(n), np.zeros((n, n))
        self.functions.step_map(x, u0, u1, self.holding(row), self.p, self.g, new, J)
        return new, J

    def decays(self, x: Floats, u: Floats, row: int) -> tuple[Floats, Floats]:
        """Own decay (n) of every stiff state, 1/s, and its derivative (n, n)."""
        decay, D = np.zeros(len(x)), np.zeros((len(x), len(x)))
        self.functions.decays(x, u, self.holding(row), self.p, self.g, decay, D)
        return decay, D

    def predict_x(self, u: tuple[float, Floats, Floats, int] | int = 0) -> None:
        """Heun's rule over ``u`` = (dt s, inputs at start, inputs at end, regime row), in stiff
        states with their own decay taken exactly.

        Sets ``F`` and ``Q`` for filterpy's own propagation of P.
        """
        assert isinstance(u, tuple)
        dt, u0, u1, row = u
        n, line, x = self.states, self.timeline, self.x[: self.states]
        one = np.eye(n)
        f0, A0, B0 = self.rates(x, u0, row)
        decay, D = self.decays(x, u0, row)
        phi1, phi2, by_z1, by_z2 = phi(decay * dt)
        D = dt * D
        guess, J0 = self.mapped(x + dt * phi1 * f0, u0, u1, row)
        f1, A1, B1 = self.rates(guess, u1, row)
        power0, power1 = self.power(x, u0, row), self.power(guess, u1, row)
        energy = dt / 2 * (power0[0] + power1[0])
        bend = f1 - f0 - decay * (guess - x)
        xn, J1 = self.mapped(x + dt * (phi1 * f0 + phi2 * bend), u0, u1, row)
        straight = dt * (phi1[:, None] * A0 + (f0 * by_z1)[:, None] * D)
        G = J0 @ (one + straight)
        bent = A1 @ G - A0 - decay[:, None] * (G - one) - (guess - x)[:, None] * D / dt
        bent = dt * (phi2[:, None] * bent + (bend * by_z2)[:, None] * D)
        if self.consider:
            self.F = np.eye(self.dim_x)
            self.F[:n, n + 1 :], self.F[n, n + 1 :] = self.by_parameters(x, xn, u)
            self.F[n, :n] = dt / 2 * (power0[1] + power1[1] @ G)
            self.x[n] += energy
        self.x[:n] = xn
        self.F[:n, :n] = J1 @ (one + straight + bent)
        lasting = phi(2 * decay * dt)[0]
        B0, B1 = np.sqrt(lasting)[:, None] * B0, np.sqrt(lasting)[:, None] * B1
        of_inputs = (B0 * line.noise) @ B0.T + (B1 * line.noise) @ B1.T
        of_process = dt * lasting * line.Q[row, :n] + abs(energy) * line.Q[row, n:]
        self.Q = np.zeros((self.dim_x, self.dim_x))
        self.Q[:n, :n] = np.diag(of_process) + dt / 2 * of_inputs

    def by_parameters(
        self, x: Floats, xn: Floats, u: tuple[float, Floats, Floats, int]
    ) -> tuple[Floats, Floats]:
        """Derivatives (n, m) and (m) of a step from ``x`` to ``xn`` and of its energy by the
        uncertain parameters, at the inputs that other measurements imply: see
        ``compute.kernel.step_answer``."""
        dt, u0, u1, row = u
        w, v0, v1 = self.holding(row), np.zeros(len(u0)), np.zeros(len(u1))
        self.functions.implied(x, u0, w, self.p, self.g, v0)
        self.functions.implied(xn, u1, w, self.p, self.g, v1)
        m = self.functions.THETAS
        G, of_energy = np.zeros((self.states, m)), np.zeros(m)
        slope = (v1 - v0) / dt
        self.functions.step_signature(x, v0, v1, dt, w, self.p, self.g, slope, G, of_energy)
        return G, of_energy

    def advance(self, span: float, u0: Floats, u1: Floats, row: int) -> None:
        """Predict over ``span`` s, in steps no longer than the regime allows."""
        steps = ceil(span / self.timeline.longest[row])
        slope = (u1 - u0) / steps
        for step in range(steps):
            ua, ub = u0 + step * slope, u0 + (step + 1) * slope
            self.predict((span / steps, ua, ub, row))

    def predicted(self, sensor: int, x: Floats, u: Floats, row: int) -> tuple[float, Floats]:
        """A sensor's reading at ``x``, and its derivative by all that ``x`` holds."""
        n, w = self.states, self.holding(row)
        H, by_theta = np.zeros(self.dim_x), np.zeros(self.functions.THETAS)
        h = self.functions.reading(sensor, x[:n], u, w, self.p, self.g, H[:n])
        if self.consider:
            self.functions.reading_signature(sensor, x[:n], u, w, self.p, self.g, by_theta)
            H[n + 1 :] = by_theta
        return float(h), H

    def correct(
        self, sensor: int, z: float, R: float, u: Floats, row: int
    ) -> tuple[float, float, float]:
        """Take one reading; returns innovation, its predicted and its used variance."""
        h, H = self.predicted(sensor, self.x, u, row)
        S = float(H @ self.P @ H) + R
        used = max(S, (z - h) ** 2 / self.limit**2)
        measured, R_used = np.array([z]), R + (used - S)
        if self.consider:
            self._leave_constants(measured - h, H, R_used)
        else:
            self.update(
                measured, HJacobian=lambda x: H[None, :], Hx=lambda x: np.array([h]), R=R_used
            )
            self.SI = 1.0 / self.S  # which filterpy 1.4 leaves as it was
        self._in_proportion(z - h)
        return float(z - h), float(S), float(used)

    def _own(self) -> tuple[Floats, Floats]:
        """Covariance of states and energy but for what parameters do to them, and that rest; both
        as large as ``P`` is without the parameters."""
        k = self.states + 1 if self.consider else self.states
        across, variance = self.P[:k, k:], np.diag(self.P)[k:]
        theirs = across / np.where(variance > 0.0, variance, 1.0) @ across.T
        return self.P[:k, :k] - theirs, theirs

    def _in_proportion(self, innovation: float) -> None:
        """See ``compute.kernel.in_proportion``; what parameters do to the state stays as it is."""
        scales, doubted = self.functions.SCALES, self.functions.DOUBTED
        if not len(scales) and not len(doubted):
            return
        own, theirs = self._own()
        for i in scales:
            before = self.x[i] - float(self.K[i, 0]) * innovation
            ratio = self.x[i] / before if before > 0.0 < self.x[i] else 1.0
            own[i] *= ratio
            own[:, i] *= ratio
        self.P[: len(own), : len(own)] = own + theirs
        self.doubts = np.sqrt(np.diag(own)[doubted])

    def _leave_constants(self, innovation: Floats, H: Floats, R: float) -> None:
        """filterpy's update with no gain on energy and parameters: Joseph's form allows any."""
        self.y, self.S = innovation, np.array([[H @ self.P @ H + R]])
        self.SI = 1.0 / self.S
        self.K = (self.P @ H)[:, None] * self.SI
        self.K[self.states :] = 0.0
        self.x = self.x + self.K[:, 0] * innovation
        rest = np.eye(self.dim_x) - self.K * H
        self.P = rest @ self.P @ rest.T + R * (self.K @ self.K.T)
        self._log_likelihood = self._likelihood = self._mahalanobis = None

    def take(self, k: int) -> tuple[float, float, float] | None:
        """Predict to event ``k`` of the timeline from the one before it, and take its reading:
        innovation, its predicted and its used variance; None where nothing is read."""
        line = self.timeline
        if k and line.t[k] > line.t[k - 1]:
            self.advance(line.t[k] - line.t[k - 1], line.u[k - 1], line.u[k], line.row[k])
        if line.sensor[k] < 0:
            return None
        return self.correct(line.sensor[k], line.z[k], line.R[k], line.u[k], line.row[k])

    def run(self) -> tuple[Floats, Floats, float]:
        """Filter the whole timeline: ``x`` and ``P`` after every event, log-likelihood."""
        line = self.timeline
        xs, Ps = np.empty((len(line.t), self.dim_x)), np.empty((len(line.t), *self.P.shape))
        total = 0.0
        for k in range(len(line.t)):
            if self.take(k) is not None:
                total += float(self.log_likelihood)
            xs[k], Ps[k] = self.x, self.P
        return xs, Ps, total

    def belief(self) -> Belief:
        """State, covariance and responses as the whole-log filter has them (with ``consider``)."""
        n, own = self.states, self._own()[0]
        variance = self.compiled.spread**2
        S = self.P[: n + 1, n + 1 :] / np.where(variance > 0.0, variance, 1.0)
        held = np.full(n, -1.0)
        held[: len(self.doubts)] = self.doubts
        return Belief(
            x=self.x[:n].copy(),
            P=own[:n, :n].copy(),
            S=S[:n].copy(),
            E=np.array([self.x[n], own[n, n]]),
            cE=own[n, :n].copy(),
            sE=S[n].copy(),
            held=held,
        )


def _with_constants(start: Belief, spread: Floats) -> tuple[Floats, Floats]:
    """``x`` and ``P`` with slip energy and parameters behind the states."""
    variance = np.diag(spread**2)
    responses = np.vstack([start.S, start.sE])
    across = responses @ variance
    own = np.block([[start.P, start.cE[:, None]], [start.cE[None, :], start.E[1:, None]]])
    P = np.block([[own + across @ responses.T, across], [across.T, variance]])
    return np.concatenate([start.x, start.E[:1], np.zeros(len(spread))]), P


def phi(z: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """φ_1 = (e^z − 1)/z and φ_2 = (φ_1 − 1)/z with their derivatives, for z ≤ 0: quotients where
    they have their digits, else Σ z^k/(k + 1)! and Σ z^k/(k + 2)!."""
    large = np.minimum(z, -SMALL)
    one = np.expm1(large) / large
    by_one = (np.exp(large) - one) / large
    two = (one - 1) / large
    by_two = (by_one - two) / large
    series = [
        np.polynomial.Polynomial([1 / factorial(k + n) for k in range(TERMS + 2 - n)])
        for n in (1, 2)
    ]
    small = [value(z) for value in (*series, *(value.deriv() for value in series))]
    quotients = (one, two, by_one, by_two)
    one, two, by_one, by_two = (
        np.where(z < -SMALL, a, b) for a, b in zip(quotients, small, strict=True)
    )
    return one, two, by_one, by_two
