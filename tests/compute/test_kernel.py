"""The kernel: covariances stay covariances, and on a linear model it is Kalman's filter."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from math import ceil, log, pi

import numpy as np
import pytest

from bench import Bench
from clutchest.compute import build
from clutchest.estimate import whole_log
from clutchest.estimate.ekf import OnlineFilter
from clutchest.estimate.timeline import Timeline
from clutchest.estimate.whole_log import Belief, Compiled, FilterOptions, copied, first_belief

from . import linear

BenchOf = Callable[[str], Bench]


def nothing_unknown(n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """No unknown parameters: responses (n, 0) and (0), variances (0)."""
    return np.zeros((n, 0)), np.zeros(0), np.zeros(0)


def test_covariances_stay_symmetric_and_positive_definite(bench: BenchOf) -> None:
    """1e5 random steps, over ten decades of noise and sixteen of measurement accuracy."""
    functions = bench("dry_clutch").bare.functions
    n, rng = functions.STATES, np.random.default_rng(8)
    P, T, K, PH = np.eye(n), np.zeros((n, n)), np.zeros(n), np.zeros(n)
    S, Hm, considered = nothing_unknown(n)
    x, smallest = np.zeros(n), np.inf
    for k in range(100_000):
        if k % 100 == 0:
            F = 0.995 * np.eye(n) + 0.05 * rng.normal(size=(n, n)) * (rng.random((n, n)) < 0.3)
            F *= min(1.0, 1.0 / np.abs(np.linalg.eigvals(F)).max())
            Q = np.diag(10.0 ** rng.uniform(-10.0, 0.0, n))
            H, R = rng.normal(size=n) * (rng.random(n) < 0.5), 10.0 ** rng.uniform(-12.0, 4.0)
        functions.propagate(P, F, Q, T)
        functions.update(x, P, S, 0.0, H, Hm, rng.normal(), R, considered, K, PH, 5.0)
        if k % 100 == 99:
            assert np.array_equal(P, P.T)
            std = np.sqrt(np.diag(P))
            smallest = min(smallest, np.linalg.eigvalsh(P / np.outer(std, std)).min())
    assert smallest > 0.0


def test_an_update_never_adds_uncertainty(bench: BenchOf) -> None:
    functions = bench("dry_clutch").bare.functions
    n, rng = functions.STATES, np.random.default_rng(9)
    S, Hm, considered = nothing_unknown(n)
    for _ in range(200):
        root = rng.normal(size=(n, n))
        P = root @ root.T
        P = (P + P.T) / 2
        before, x, H = P.copy(), rng.normal(size=n), rng.normal(size=n)
        start, R, z = x.copy(), 10.0 ** rng.uniform(-6.0, 6.0), rng.normal()
        innovation, predicted, used = functions.update(
            x, P, S, float(H @ x), H, Hm, z, R, considered, np.zeros(n), np.zeros(n), 1e9
        )
        assert used == predicted == pytest.approx(H @ before @ H + R)
        assert innovation == z - H @ start
        gain = before @ H / predicted
        np.testing.assert_allclose(x, start + gain * innovation, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(P, before - np.outer(gain, H @ before), rtol=1e-6, atol=1e-9)
        assert np.linalg.eigvalsh(before - P).min() > -1e-9 * np.abs(before).max()


def test_what_fades_becomes_nought(bench: BenchOf) -> None:
    """Covariances with a state that is measured without end: numbers below the normal ones would
    make the filter twice as slow."""
    functions = bench("dry_clutch").bare.functions
    n = functions.STATES
    P, F, Q = np.full((n, n), 0.5) + 0.5 * np.eye(n), np.eye(n), np.diag(np.eye(n)[0])
    T, x, (S, Hm, considered) = np.zeros((n, n)), np.zeros(n), nothing_unknown(n)
    for _ in range(5000):
        functions.propagate(P, F, Q, T)
        functions.update(
            x, P, S, 0.0, np.eye(n)[0], Hm, 0.0, 1.0, considered, np.zeros(n), np.zeros(n), 5.0
        )
    assert np.all(P[0, 1:] == 0.0)
    assert np.all(np.diag(P) > 0.1)


def test_an_outlier_counts_for_less(bench: BenchOf) -> None:
    """Beyond 5 standard deviations its variance is raised until it is at 5."""
    functions = bench("dry_clutch").bare.functions
    n = functions.STATES
    H, x, P = np.eye(n)[0], np.zeros(n), np.eye(n)
    S, Hm, considered = nothing_unknown(n)
    innovation, predicted, used = functions.update(
        x, P, S, 0.0, H, Hm, 100.0, 1.0, considered, np.zeros(n), np.zeros(n), 5.0
    )
    assert (innovation, predicted) == (100.0, 2.0)
    assert used == pytest.approx(100.0**2 / 5.0**2)
    assert x[0] == pytest.approx(100.0 / used)
    assert P[0, 0] == pytest.approx(1.0 - 1.0 / used)


# --- the linear model ---


@dataclass
class Kalman:
    """The textbook's filter for the two tanks, with the energy as a state no gain touches."""

    E: np.ndarray  # x and energy
    P: np.ndarray
    log_likelihood: float = 0.0

    def predict(self, dt: float, u0: float, u1: float, q: np.ndarray, noise: float) -> None:
        one, A, B = np.eye(2), linear.A, linear.B[:, 0]
        F = one + dt * A + dt**2 / 2 * A @ A
        e = dt / 2 * np.array([3.0, 0.0]) @ (2 * one + dt * A)
        x, f0 = self.E[:2], A @ self.E[:2] + B * u0
        ahead = x + dt * f0
        energy = dt / 2 * 3.0 * (x[0] + ahead[0])
        self.E[2] += energy
        self.E[:2] = x + dt / 2 * (f0 + A @ ahead + B * u1)
        whole = np.block([[F, np.zeros((2, 1))], [e[None, :], np.ones((1, 1))]])
        Q = np.zeros((3, 3))
        Q[:2, :2] = dt * (np.diag(q[:2]) + noise * np.outer(B, B)) + abs(energy) * np.diag(q[2:])
        self.P = whole @ self.P @ whole.T + Q

    def correct(self, H: np.ndarray, z: float, R: float) -> float:
        H = np.append(H, 0.0)
        S = H @ self.P @ H + R
        K = self.P @ H / S
        K[2] = 0.0
        innovation = z - H @ self.E
        self.E = self.E + K * innovation
        rest = np.eye(3) - np.outer(K, H)
        self.P = rest @ self.P @ rest.T + R * np.outer(K, K)
        self.log_likelihood -= 0.5 * (log(2 * pi * S) + innovation**2 / S)
        return float(innovation)


@pytest.fixture(scope="module")
def tanks() -> tuple[Compiled, Timeline, Belief]:
    """Irregular events, two gauges, some of them at one time, an inflow that bends."""
    rng, K = np.random.default_rng(10), 600
    t = np.sort(np.round(rng.uniform(0.0, 30.0, K), 2))
    sensor = rng.integers(-1, 2, K).astype(np.int8)
    digest, functions = linear.compiled()
    compiled = Compiled(
        linear.MACHINE,
        linear.TANKS,
        functions,
        digest,
        linear.NUMBERS,
        np.zeros(0),
        (),
        np.zeros(0),
    )
    line = Timeline(
        t=t,
        sensor=sensor,
        z=rng.normal(3.0, 2.0, K),
        R=10.0 ** rng.uniform(-4, 1, K),
        u=np.interp(t, np.linspace(0, 30, 40), rng.normal(1.0, 1.0, 40))[:, None],
        row=rng.integers(0, 2, K),
        W=np.zeros((2, 0)),
        Q=np.array([[0.1, 0.02, 0.01, 0.0], [0.5, 0.3, 0.0, 0.02]]),
        longest=np.array([0.02, 0.007]),
        mode=np.zeros(K, np.uint8),
        emit=np.arange(K),
        grid=np.ones(K, bool),
        noise=np.array([0.3]),
        variance=np.array([0.2]),
        warnings=(),
    )
    return (
        compiled,
        line,
        first_belief(np.array([2.0, 1.0]), np.array([[2.0, 0.3], [0.3, 1.0]]), np.zeros((2, 0))),
    )


def test_on_a_linear_model_it_is_the_kalman_filter(
    tanks: tuple[Compiled, Timeline, Belief],
) -> None:
    compiled, line, belief = tanks
    ours = whole_log.run(compiled, line, belief, FilterOptions(limit=1e9))
    plain = Kalman(np.append(belief.x, 0.0), np.zeros((3, 3)))
    plain.P[:2, :2] = belief.P
    for k in range(len(line.t)):
        row = line.row[k]
        if k and line.t[k] > line.t[k - 1]:
            span = line.t[k] - line.t[k - 1]
            steps = ceil(span / line.longest[row])
            u = np.linspace(line.u[k - 1, 0], line.u[k, 0], steps + 1)
            for a, b in pairwise(u):
                plain.predict(span / steps, a, b, line.Q[row], line.noise[0])
        if line.sensor[k] >= 0:
            innovation = plain.correct(linear.H[line.sensor[k]], line.z[k], line.R[k])
            assert ours.innovation[k, 0] == pytest.approx(innovation, rel=1e-9, abs=1e-10)
        np.testing.assert_allclose(ours.x[k], plain.E[:2], rtol=1e-10, atol=1e-10)
        np.testing.assert_allclose(ours.P[k], plain.P[:2, :2], rtol=1e-9, atol=1e-12)
        assert ours.energy[k, 0] == pytest.approx(plain.E[2], rel=1e-10)
        assert ours.energy[k, 1] == pytest.approx(plain.P[2, 2], rel=1e-9)
        total, power = ours.outputs[k]
        x, P = plain.E[:2], plain.P[:2, :2]
        assert total == pytest.approx([x.sum(), P.sum()], rel=1e-9, abs=1e-10)
        assert power == pytest.approx([3 * x[0], 9 * P[0, 0]], rel=1e-9, abs=1e-10)
    assert ours.log_likelihood == pytest.approx(plain.log_likelihood, rel=1e-10)
    assert build.is_compiled(compiled.digest)
    assert not build.is_compiled("0" * 16)


@pytest.mark.slow
def test_filterpys_engine_agrees_on_a_linear_model(
    tanks: tuple[Compiled, Timeline, Belief],
) -> None:
    compiled, line, belief = tanks
    ours = whole_log.run(compiled, line, belief)
    xs, Ps, total = OnlineFilter(compiled, belief, line).run()
    np.testing.assert_allclose(ours.x, xs, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(ours.P, Ps, rtol=1e-9, atol=1e-12)
    assert ours.log_likelihood == pytest.approx(total, rel=1e-10)


def test_a_log_in_pieces_gives_the_same_bits(
    tanks: tuple[Compiled, Timeline, Belief], monkeypatch: pytest.MonkeyPatch
) -> None:
    compiled, line, belief = tanks
    whole = whole_log.run(compiled, line, belief)
    monkeypatch.setattr(whole_log, "CHUNK", 77)
    pieces = whole_log.run(compiled, line, belief)
    assert np.array_equal(whole.x, pieces.x)
    assert np.array_equal(whole.P, pieces.P)
    assert np.array_equal(whole.energy, pieces.energy)
    assert np.array_equal(whole.innovation, pieces.innovation)
    assert np.isclose(whole.log_likelihood, pieces.log_likelihood, rtol=1e-13)


def test_frozen_gains_repeat_the_run(tanks: tuple[Compiled, Timeline, Belief]) -> None:
    compiled, line, belief = tanks
    free = whole_log.run(compiled, line, belief, FilterOptions(keep=True))
    frozen = whole_log.run(compiled, line, belief, FilterOptions(gains=free.gains))
    assert np.array_equal(free.x, frozen.x)
    assert np.array_equal(free.innovation[:, 0], frozen.innovation[:, 0])


def test_a_run_leaves_its_start_alone(tanks: tuple[Compiled, Timeline, Belief]) -> None:
    compiled, line, belief = tanks
    before = copied(belief)
    whole_log.run(compiled, line, belief)
    assert np.array_equal(belief.x, before.x)
    assert np.array_equal(belief.P, before.P)
