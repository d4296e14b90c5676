"""Thresholds against laws that are known, and against draws that they were not computed from."""

import numpy as np
import pytest
from scipy.stats import norm

from clutchest.diagnosis import sequential, thresholds
from clutchest.diagnosis.thresholds import (
    Autoregression,
    cusum_path,
    from_path,
    glr_path,
    simulated,
    threshold,
)


def average_run_length(delta, bound, cells=400):
    """Of Page's sum over δz − δ²/2, by Brook and Evans's Markov chain on ``cells`` levels."""
    width = bound / (cells - 0.5)
    levels = np.arange(cells) * width

    def below(x):
        return norm.cdf((x + delta**2 / 2) / delta)

    upper = levels[None, :] + width / 2 - levels[:, None]
    step = below(upper) - below(upper - width)
    step[:, 0] = below(width / 2 - levels)
    return np.linalg.solve(np.eye(cells) - step, np.ones(cells))[0]


@pytest.mark.parametrize("delta", [0.3, 1.0])
def test_a_cusum_alarms_as_seldom_as_asked_for(delta):
    rate = 4e-4
    h = threshold(
        lambda s, i: cusum_path(s, i, 1.0, True)[0], np.full(100, delta**2), Autoregression(), rate
    )
    assert 1 / rate == pytest.approx(average_run_length(delta, h), rel=0.25)


@pytest.mark.parametrize("noise_model", [Autoregression(), Autoregression(1.1, 0.3)])
def test_a_rate_holds_on_other_draws_than_those_of_the_threshold(noise_model):
    rng = np.random.default_rng(7)
    information = rng.exponential(0.5, 300)
    rate = 2e-5

    def test(score, resampled):
        return glr_path(score, resampled, 0.1, 3.0)[0]

    h = threshold(test, information, noise_model, rate)
    blocks = 2_000_000
    path = test(*simulated(information, noise_model, blocks, np.random.default_rng(11)))
    count = len(sequential.peaks(path, h, thresholds.WINDOW))
    assert 0.5 < count / (rate * blocks) < 2.0  # 40 expected


def test_a_threshold_that_healthy_vehicles_hardly_reach_is_not_zero():
    """Of residuals that are sharp against the smallest size, paths hardly leave 0: with a threshold
    of 0 the least of a fault would be an alarm, and the ratio to it no number."""
    path = np.zeros(1_000_000)
    path[::5_000] = 1e-3
    path[::100_000] = 9.0
    assert from_path(path, 1e-4) == from_path(np.zeros(1000), 1e-4) > 0.0


def test_a_threshold_that_fewer_than_the_wanted_peaks_reach_is_not_zero():
    """Of a fault that seldom shows, three peaks where fifty alarms are allowed."""
    path = np.zeros(1000)
    path[[100, 400, 700]] = 1.2
    assert from_path(path, 0.05) == from_path(np.zeros(1000), 0.05) > 0.0


def test_autocorrelation_is_estimated_and_a_fault_has_no_influence():
    rng = np.random.default_rng(3)
    z = rng.standard_normal(4000)
    for k in range(1, len(z)):
        z[k] = 0.4 * z[k - 1] + np.sqrt(1 - 0.16) * z[k]
    model = Autoregression.of(1.3 * z)
    assert model.level == pytest.approx(1.3, abs=0.07)
    assert model.coefficient == pytest.approx(0.4, abs=0.06)
    z[2000:2200] += 8.0
    assert Autoregression.of(1.3 * z).level == pytest.approx(model.level, abs=0.1)


def brute_glr(score, information, low, high, k):
    best, first = 0.0, k
    for j in range(max(k - thresholds.WINDOW + 1, 0), k + 1):
        u, i = score[j : k + 1].sum(), information[j : k + 1].sum()
        b = np.clip(u / i, low, high)
        if b * u - b**2 * i / 2 > best:
            best, first = b * u - b**2 * i / 2, j
    return best, first


def test_the_glr_tries_every_onset_and_size():
    rng = np.random.default_rng(5)
    information = rng.exponential(1.0, 120)
    score = np.sqrt(information) * rng.standard_normal(120) + 0.6 * information * (
        np.arange(120) > 80
    )
    path, begun = glr_path(score, information, 0.2, 2.0, one_sided=True)
    for k in (0, 40, 79, 100, 119):
        best, first = brute_glr(score, information, 0.2, 2.0, k)
        assert path[k] == pytest.approx(best)
        assert begun[k] == first or best == 0.0
    assert abs(begun[119] - 81) < 12


def test_pages_sum_is_carried_from_batch_to_batch():
    gains = np.random.default_rng(2).normal(-0.1, 1.0, 500)
    whole, begun = np.zeros(500), np.zeros(500, np.int64)
    sequential.cusum(gains, 0.0, whole, begun)
    level, pieces = 0.0, []
    for part in np.array_split(gains, 17):
        path, first = np.zeros(len(part)), np.zeros(len(part), np.int64)
        level = sequential.cusum(part, level, path, first)
        pieces.append(path)
    assert np.concatenate(pieces) == pytest.approx(whole)


def test_an_estimated_tail_is_exceeded_as_seldom_as_stated():
    rng, count = np.random.default_rng(4), 0
    for _ in range(300):
        tail = sequential.new_tail(1.0)
        for x in rng.exponential(1.0, 500):
            sequential.tail_take(tail, x)
        count += int(np.sum(rng.exponential(1.0, 500) > sequential.tail_bound(tail, 500.0)))
    assert count < 300  # at most once in each of 300


def test_a_failing_cusum_heals_within_twice_its_bound():
    """However long the fault has lasted: the sum is limited, so that 20 healthy samples undo it."""
    state, changes, n = np.zeros(3), np.zeros((4, 2)), 0
    gains = np.r_[np.full(5, -1.0), np.full(1000, 1.0), np.full(30, -1.0)]
    for k, gain in enumerate(gains):
        n = sequential.cusum_step(state, gain, 10.0, float(k), changes, n)
    assert n == 2
    begun, detected = changes[0]
    assert (begun, detected) == (5.0, 15.0)
    assert np.isnan(changes[1, 0]) and changes[1, 1] == 1004.0 + 20.0
