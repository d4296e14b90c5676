"""The smoother: textbook answers where there are any, honest statistics where not."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace
from itertools import pairwise
from math import ceil

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from scipy.stats import chi2

import clutchest
import drawn
from clutchest import generated
from clutchest.compute import build
from clutchest.estimate import smooth, timeline, whole_log
from clutchest.estimate.initial_state import fresh
from clutchest.estimate.smooth import Smoothed, smoothed
from clutchest.estimate.timeline import Timeline
from clutchest.estimate.whole_log import CONSIDERING, Belief, Compiled, FilterOptions, first_belief
from clutchest.models import machine_of
from clutchest.models.model import Quantities
from clutchest.models.symbols import Parameter
from compute import linear

TRUCK = clutchest.load_vehicle("truck")
STATES = ("temp_body", "temp_housing", "temp_disc", "zero_position", "friction")


# --- two tanks with two unknown parameters that everything is linear in ---


def feed(q: Quantities) -> None:
    """An unknown flow into the lower tank."""
    q.lower_rate = q.lower_rate + q.feed


def tare(q: Quantities) -> None:
    """The scales show too much."""
    q.weight_reading = q.weight_reading + q.tare


TANKS = replace(
    linear.TANKS,
    name="two tanks and scales",
    parameters=(
        *linear.TANKS.parameters,
        Parameter("feed", "m/s", "f", "into the lower"),
        Parameter("tare", "m", "t", "of the scales"),
    ),
    pieces=(*linear.TANKS.pieces, feed, tare),
)
THETAS = (("parameter", "feed"), ("parameter", "tare"))
NOMINAL = np.array([*linear.NUMBERS, 0.05, 0.4])


def tanks(spread: tuple[float, float], count: int = 600) -> tuple[Compiled, Timeline, Belief]:
    """Irregular events, gauges at one time, far-off readings, process noise that is singular."""
    rng = np.random.default_rng(10)
    t = np.sort(np.round(rng.uniform(0.0, count / 20, count), 2))
    digest, text = build.generate(TANKS, THETAS)
    compiled = Compiled(
        linear.MACHINE,
        TANKS,
        generated.load(digest, text),
        digest,
        NOMINAL,
        np.zeros(0),
        THETAS,
        np.array(spread),
    )
    z = rng.normal(3.0, 2.0, count)
    z[::97] += 60.0
    last = np.append(np.diff(t) > 0, True)
    line = Timeline(
        t=t,
        sensor=rng.integers(-1, 2, count).astype(np.int8),
        z=z,
        R=10.0 ** rng.uniform(-4, 1, count),
        u=np.interp(t, np.linspace(0, t[-1], 40), rng.normal(1.0, 1.0, 40))[:, None],
        row=rng.integers(0, 2, count),
        W=np.zeros((2, 0)),
        Q=np.array([[0.0, 0.0, 0.0, 0.0], [0.5, 0.0, 0.0, 0.0]]),
        longest=np.array([0.02, 0.007]),
        mode=np.zeros(count, np.uint8),
        emit=np.where(last, np.cumsum(last) - 1, -1),
        grid=np.arange(last.sum()) % 3 != 1,
        noise=np.array([0.0]),
        variance=np.array([0.2]),
        warnings=(),
    )
    return (
        compiled,
        line,
        first_belief(
            np.array([2.0, 1.0]),
            np.array([[2.0, 0.3], [0.3, 1.0]]),
            np.array([[0.2, -0.1], [0.4, 0.0]]),
        ),
    )


def textbook(
    compiled: Compiled, line: Timeline, start: Belief, R: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Rauch, Tung and Striebel's recursion, dense, θ among the states; after every event."""
    spread, count = np.diag(compiled.spread**2), len(line.t)
    across = start.S @ spread
    x = np.append(start.x, NOMINAL[2:])
    P = np.block([[start.P + across @ start.S.T, across], [across.T, spread]])
    A, B = np.zeros((4, 4)), np.array([1.0, 0.0, 0.0, 0.0])
    A[:2, :2], A[1, 2] = linear.A, 1.0
    H = np.hstack([linear.H, [[0.0, 0.0], [0.0, 1.0]]])
    xs, Ps, ahead = np.empty((count, 4)), np.empty((count, 4, 4)), []
    for k in range(count):
        whole, Q, shift = np.eye(4), np.zeros((4, 4)), np.zeros(4)
        span = line.t[k] - line.t[k - 1] if k else 0.0
        number = ceil(span / line.longest[line.row[k]])
        dt = span / max(number, 1)
        F = np.eye(4) + dt * A + dt**2 / 2 * A @ A
        noise = dt * np.diag([*line.Q[line.row[k], :2], 0.0, 0.0])
        for u0, u1 in pairwise(np.linspace(line.u[k - 1, 0], line.u[k, 0], number + 1)):
            whole, Q = F @ whole, F @ Q @ F.T + noise
            shift = F @ shift + dt / 2 * B * (u0 + u1) + dt**2 / 2 * A @ B * u0
        x, P = whole @ x + shift, whole @ P @ whole.T + Q
        ahead.append((whole, x, P))
        if line.sensor[k] >= 0:
            h = H[line.sensor[k]]
            K = P @ h / (h @ P @ h + R[k])
            rest = np.eye(4) - np.outer(K, h)
            x, P = x + K * (line.z[k] - h @ x), rest @ P @ rest.T + R[k] * np.outer(K, K)
        xs[k], Ps[k] = x, P
    for k in range(count - 2, -1, -1):
        whole, x, P = ahead[k + 1]
        J = Ps[k] @ whole.T @ np.linalg.pinv(P, hermitian=True)
        xs[k] += J @ (xs[k + 1] - x)
        Ps[k] += J @ (Ps[k + 1] - P) @ J.T
    return xs[:, :2], Ps[:, :2, :2]


def both(spread: tuple[float, float]) -> tuple[Smoothed, np.ndarray, np.ndarray]:
    """Ours, and the textbook's on the same rows."""
    compiled, line, start = tanks(spread)
    filtered = whole_log.run(compiled, line, start, CONSIDERING)
    _, predicted, used = filtered.innovation.T
    assert np.any(used > predicted)  # some readings are far off
    xs, Ps = textbook(compiled, line, start, line.R + (used - predicted))
    rows = np.flatnonzero(line.emit >= 0)[line.grid]
    return smoothed(compiled, line, start, filtered), xs[rows], Ps[rows]


@pytest.mark.parametrize("spread", [(0.0, 0.0), (0.3, 0.5), (0.0, 2.0)])
def test_on_a_linear_model_it_is_the_textbook_s(spread: tuple[float, float]) -> None:
    ours, xs, Ps = both(spread)
    std = np.sqrt(np.einsum("rii->ri", Ps))
    assert np.max(np.abs(ours.x - xs) / np.maximum(np.abs(xs), std)) < 1e-8
    assert np.max(np.abs(ours.P - Ps) / (std[:, :, None] * std[:, None, :])) < 1e-8
    assert np.linalg.eigvalsh(ours.P / (std[:, :, None] * std[:, None, :])).min() > 0


def test_it_agrees_with_filterpy() -> None:
    """Its filter has no inputs: the tanks run empty, with parameters of 0 that are certain."""
    compiled, line, start = tanks((0.0, 0.0))
    compiled = replace(compiled, p=np.array([*linear.NUMBERS, 0.0, 0.0]))
    count = 300
    t = np.arange(count) * 0.005
    line = replace(
        line,
        t=t,
        sensor=np.arange(count) % 3 % 2,
        z=line.z[:count],
        R=line.R[:count],
        u=np.zeros((count, 1)),
        row=np.ones(count, np.int64),
        emit=np.arange(count),
        grid=np.ones(count, bool),
        mode=np.zeros(count, np.uint8),
    )
    line = replace(line, sensor=line.sensor.astype(np.int8))
    filtered = whole_log.run(compiled, line, start, FilterOptions(limit=1e9))
    ours = smoothed(compiled, line, start, filtered)
    A, dt = linear.A, 0.005
    F, Q = np.eye(2) + dt * A + dt**2 / 2 * A @ A, dt * np.diag(line.Q[1, :2])
    theirs = KalmanFilter(2, 1).rts_smoother(filtered.x, filtered.P, [F] * count, [Q] * count)
    np.testing.assert_allclose(ours.x, theirs[0], rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(ours.P, theirs[1], rtol=1e-8, atol=1e-12)


def test_windows_leave_no_trace(monkeypatch: pytest.MonkeyPatch) -> None:
    compiled, line, start = tanks((0.3, 0.5))
    filtered = whole_log.run(compiled, line, start, CONSIDERING)
    whole = smoothed(compiled, line, start, filtered)
    for window in (1, 77, 600):
        monkeypatch.setattr(smooth, "WINDOW", window)
        pieces = smoothed(compiled, line, start, filtered)
        np.testing.assert_allclose(pieces.x, whole.x, rtol=1e-10, atol=1e-10)
        np.testing.assert_allclose(pieces.P, whole.P, rtol=1e-9, atol=1e-12)


def test_memory_is_that_of_a_window(monkeypatch: pytest.MonkeyPatch) -> None:
    """Beyond what it gives back, a log ten times as long takes a few bytes more per event: a mark
    for each and a checkpoint per window.  One event alone leaves 120 bytes for the way back."""
    monkeypatch.setattr(smooth, "WINDOW", 500)
    peaks = []
    for count in (5_000, 50_000):
        compiled, line, start = tanks((0.3, 0.5), count)
        filtered = whole_log.run(compiled, line, start, CONSIDERING)
        tracemalloc.start()
        result = smoothed(compiled, line, start, filtered)
        peaks.append(tracemalloc.get_traced_memory()[1] - result.x.nbytes - result.P.nbytes)
        tracemalloc.stop()
    assert peaks[1] - peaks[0] < 12 * 45_000


def test_progress_is_told_from_start_to_end() -> None:
    compiled, line, start = tanks((0.3, 0.5))
    filtered = whole_log.run(compiled, line, start)
    told: list[tuple[str, float | None]] = []
    smoothed(compiled, line, start, filtered, lambda *what: told.append(what))
    shares = [share for _, share in told]
    assert {text for text, _ in told} == {"smoothing"}
    assert shares[0] == 0.0 and shares[-1] == 1.0
    assert shares == sorted(shares)


# --- the truck ---


@pytest.mark.slow
def test_on_its_own_model_it_is_consistent_and_never_less_sure() -> None:
    """Drives drawn as the filter states, its parameters certain: the normalised squared error in
    the middle of a drive within its 99.9 % interval, no standard deviation above the filter's,
    and every covariance one."""
    certain = {
        key: p if key == "zero_position_ref" else replace(p, spread=0.0)
        for key, p in TRUCK.parameters.items()
    }
    vehicle, draws = replace(TRUCK, parameters=certain), 8
    signals = clutchest.simulate(vehicle, "launches", 1, duration=160.0, nominal=True)
    compiled = whole_log.compile_model(vehicle, machine_of(vehicle.model).equations(set(signals)))
    plan = timeline.build(signals, vehicle, compiled.model, 1.0, {})
    prior = fresh(vehicle, compiled, plan)
    rows, squares = np.flatnonzero(plan.grid), []
    middle = len(rows) // 2
    for seed in range(draws):
        drive = drawn.draw(compiled, plan, prior, seed)
        filtered = whole_log.run(compiled, drive.timeline, prior, CONSIDERING)
        ours = smoothed(compiled, drive.timeline, prior, filtered)
        std = np.sqrt(ours.variance)
        assert np.all(std <= np.sqrt(filtered.total[rows]) * (1 + 1e-9))
        assert np.linalg.eigvalsh(ours.P / (std[:, :, None] * std[:, None, :])).min() > 0.0
        wrong = drive.x[rows[middle]] - ours.x[middle]
        squares.append(wrong @ np.linalg.solve(ours.P[middle], wrong))
    low, high = chi2.ppf([0.0005, 0.9995], draws * len(compiled.model.states)) / draws
    assert low < np.mean(squares) < high


def judged(scenario: str, seeds: range, duration: float | None) -> dict[str, np.ndarray]:
    """Per state (seed, 3): RMSE filtered and smoothed, and the share of rows within 1.96 σ."""
    found: dict[str, list[tuple[float, float, float]]] = {}
    for seed in seeds:
        signals = clutchest.simulate(TRUCK, scenario, seed, duration=duration)
        track, truth = clutchest.replay(signals, TRUCK, smooth=True).tracks[0], signals.truth
        assert truth is not None
        for name, ours in track.smoothed.items():
            true = np.interp(track.time, truth.time, truth.columns[name])
            before, wrong = track.states[name].value - true, ours.value - true
            inside = np.mean(np.abs(wrong) < 1.96 * ours.std)
            row = np.sqrt(np.mean(before**2)), np.sqrt(np.mean(wrong**2)), inside
            found.setdefault(name, []).append(row)
    return {name: np.array(rows) for name, rows in found.items()}


@pytest.mark.slow
def test_the_truth_lies_within_the_stated_uncertainty() -> None:
    for name, rows in judged("launches", range(4), 400.0).items():
        assert np.mean(rows[:, 2]) >= 0.9, name


def test_without_smoothing_nothing_is_said_of_it() -> None:
    signals = clutchest.simulate(TRUCK, "launches", 1, duration=60.0)
    plain = clutchest.replay(signals, TRUCK).to_pandas()
    table = clutchest.replay(signals, TRUCK, smooth=True).to_pandas()
    added = {f"{name}_smoothed{kind}" for name in STATES for kind in ("", "_std")}
    assert added <= set(table.columns) - set(plain.columns)
    assert table[list(plain.columns)].equals(plain)
    assert np.all(table.temp_body_smoothed_std <= plain.temp_body_std)


@pytest.mark.statistics
@pytest.mark.parametrize(("scenario", "drives"), [("launches", 24), ("city", 20)])
def test_it_is_better_than_the_filter(scenario: str, drives: int) -> None:
    """But where the manual says that it is not.  Launches hardly inform the housing, which the
    generator starts far closer to rest than the prior says: who moves it least is best."""
    worse = {("launches", "temp_housing")}
    for name, rows in judged(scenario, range(drives), None).items():
        if name not in STATES:
            continue
        better = np.mean(rows[:, 1] ** 2) <= np.mean(rows[:, 0] ** 2)
        assert better != ((scenario, name) in worse), name
        assert np.mean(rows[:, 2]) >= 0.9, name
