"""Whatever the linear model and the order of its events: Kalman's filter, and a covariance."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from math import ceil
from random import Random

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from clutchest.estimate import whole_log
from clutchest.estimate.timeline import Timeline
from clutchest.estimate.whole_log import Belief, Compiled, Filtered, FilterOptions, first_belief
from clutchest.signals import Floats

from . import linear

RATE = st.floats(0.0, 2.0)
DECADES = st.floats(-8.0, 3.0)
NOISE = st.one_of(st.just(0.0), DECADES.map(lambda d: 10.0**d))


@st.composite
def cases(draw: st.DrawFn) -> tuple[Compiled, Timeline, Belief]:
    """Leak and drain, noises over eleven decades or none, events alone, together or far apart.

    Of a variance, one reading leaves 1e-10 at the least: a part that double precision still tells.
    """
    K = draw(st.integers(1, 40))
    gaps = draw(
        st.lists(st.sampled_from([0.0, 0.0, 1e-6, 0.01, 0.3, 20.0]), min_size=K, max_size=K)
    )
    random = np.random.default_rng(draw(st.integers(0, 2**32)))
    digest, functions = linear.compiled()
    numbers = np.array([draw(RATE), draw(RATE)])
    compiled = Compiled(
        linear.MACHINE, linear.TANKS, functions, digest, numbers, np.zeros(0), (), np.zeros(0)
    )
    line = Timeline(
        t=np.cumsum(gaps),
        sensor=random.integers(-1, 2, K).astype(np.int8),
        z=random.normal(0.0, 10.0 ** draw(st.floats(-2, 4)), K),
        R=10.0 ** random.uniform(-5.0, 4.0, K),
        u=random.normal(1.0, 1.0, (K, 1)),
        row=random.integers(0, 2, K),
        W=np.zeros((2, 0)),
        Q=np.array([[draw(NOISE), draw(NOISE), 0.0, 0.0], [0.0, draw(NOISE), 0.0, 0.0]]),
        longest=np.array([0.5, 0.05]),
        mode=np.zeros(K, np.uint8),
        emit=np.arange(K),
        grid=np.ones(K, bool),
        noise=np.array([draw(NOISE)]),
        variance=np.array([0.2]),
        warnings=(),
    )
    root = random.normal(size=(2, 2)) * 10.0 ** draw(st.floats(-4, 2))
    P = root @ root.T + 1e-12 * np.trace(root @ root.T) * np.eye(2)
    return compiled, line, first_belief(random.normal(size=2), (P + P.T) / 2, np.zeros((2, 0)))


def textbook(compiled: Compiled, line: Timeline, prior: Belief) -> tuple[Floats, Floats]:
    """States and covariances after every event; the update in its plainest form."""
    leak, drain = compiled.p
    A, B, one = np.array([[-leak, 0.0], [leak, -drain]]), np.array([1.0, 0.0]), np.eye(2)
    x, P = prior.x.copy(), prior.P.copy()
    xs, Ps = [], []
    for k in range(len(line.t)):
        span = line.t[k] - line.t[k - 1] if k else 0.0
        if span > 0.0:
            row = line.row[k]
            steps = ceil(span / line.longest[row])
            dt, F = span / steps, one + span / steps * A + (span / steps) ** 2 / 2 * A @ A
            u = np.linspace(line.u[k - 1, 0], line.u[k, 0], steps + 1)
            Q = dt * (np.diag(line.Q[row, :2]) + line.noise[0] * np.outer(B, B))
            for a, b in pairwise(u):
                x = F @ x + dt / 2 * ((one + dt * A) @ B * a + B * b)
                P = F @ P @ F.T + Q
        if line.sensor[k] >= 0:
            H = linear.H[line.sensor[k]]
            S = H @ P @ H + line.R[k]
            K, innovation = P @ H / S, line.z[k] - H @ x
            x = x + K * innovation
            rest = one - np.outer(K, H)
            P = rest @ P @ rest.T + line.R[k] * np.outer(K, K)
        xs.append(x)
        Ps.append(P)
    return np.array(xs), np.array(Ps)


def is_covariance(ours: Filtered) -> None:
    """Symmetric to the bit, no variance below zero, no correlation beyond one but for rounding."""
    assert np.array_equal(ours.P, ours.P.transpose(0, 2, 1))
    variance = np.einsum("kii->ki", ours.P)
    assert np.all(np.isfinite(ours.P))
    assert np.all(variance >= 0.0)
    std = np.sqrt(np.maximum(variance, 1e-300))
    smallest = np.linalg.eigvalsh(ours.P / std[:, :, None] / std[:, None, :])[:, 0]
    # what rounding may do grows with how much of a variance the measurements took away
    taken = (np.maximum.accumulate(std, axis=0) / std).max(axis=1) ** 2
    assert np.all(smallest > -1e-12 - 10.0 * np.finfo(float).eps * taken)


@settings(max_examples=100, deadline=None)
@given(cases())
def test_it_is_kalmans_filter(case: tuple[Compiled, Timeline, Belief]) -> None:
    ours = whole_log.run(*case, FilterOptions(limit=1e12))
    xs, Ps = textbook(*case)
    is_covariance(ours)
    scale = np.maximum.accumulate(np.sqrt(np.einsum("kii->ki", Ps)), axis=0)
    assert np.all(np.abs(ours.P - Ps) <= 1e-9 * scale[:, :, None] * scale[:, None, :])
    size = np.maximum.accumulate(np.abs(xs), axis=0) + scale + np.abs(case[1].z).max()
    rounded = 10.0 * np.finfo(float).eps * scale.max() ** 2 / case[1].R.min()  # of a gain
    assert np.all(np.abs(ours.x - xs) <= (1e-9 + rounded) * size)


@settings(max_examples=60, deadline=None)
@given(cases(), st.randoms(use_true_random=False))
def test_readings_of_one_moment_may_come_in_any_order(
    case: tuple[Compiled, Timeline, Belief], shuffler: Random
) -> None:
    compiled, line, prior = case
    order = list(range(len(line.t)))
    shuffler.shuffle(order)
    order = sorted(order, key=lambda k: line.t[k])  # stable: only what is simultaneous moves
    # inputs and regimes belong to the moment, not to the reading
    first = np.searchsorted(line.t, line.t)
    line = replace(line, u=line.u[first], row=line.row[first])
    moved = replace(line, sensor=line.sensor[order], z=line.z[order], R=line.R[order])
    a = whole_log.run(compiled, line, prior, FilterOptions(limit=1e12))
    b = whole_log.run(compiled, moved, prior, FilterOptions(limit=1e12))
    std = np.sqrt(np.einsum("kii->ki", a.P)).max(axis=0) + 1e-300
    assert np.all(np.abs(a.final.P - b.final.P) <= 1e-7 * np.outer(std, std))
    size = np.abs(a.x).max(axis=0) + np.abs(line.z).max() + std
    assert np.all(np.abs(a.final.x - b.final.x) <= 1e-6 * size)


@settings(max_examples=60, deadline=None)
@given(cases())
def test_outliers_leave_a_covariance(case: tuple[Compiled, Timeline, Belief]) -> None:
    compiled, line, prior = case
    far = line.z.copy()
    far[::3] += 1e6
    ours = whole_log.run(compiled, replace(line, z=far), prior)
    is_covariance(ours)
    assert np.all(np.isfinite(ours.x))
