"""Residuals block by block against the same problem solved whole, by dense matrices."""

import numpy as np
import pytest

from clutchest.diagnosis.blocks import Blocks, block_index
from clutchest.diagnosis.recursive_residuals import nuisances, onset_scores, recursive_residuals
from clutchest.inference.unknowns import Unknown
from clutchest.models import machine_of

STATES = machine_of("dry_clutch").states
THETAS = (
    Unknown("parameter", "heat_capacity_body", 1.0),
    Unknown("parameter", "kiss_point", 1.0),
    Unknown("start", "friction", 0.02, drive=0),
    Unknown("friction_level", "change", 0.5, gain=True),
    Unknown("torque_gain", "change", 0.3, gain=True),
)
FAULTS = (3, 4)


def problem(seed, size=None, onset=0, blocks=12, per_block=15):
    """Blocks of a random linear problem, its rows (K, 1 + m) and the covariance of the readings."""
    rng = np.random.default_rng(seed)
    count = blocks * per_block
    psi = rng.standard_normal((count, len(THETAS)))
    psi[:, 3] = psi[:, 2] + 0.3 * psi[:, 3]  # a fault that a nuisance resembles
    of = np.repeat(np.arange(blocks), per_block)
    psi[of < onset, 3:] = 0.0
    begin = 300.0 * np.arange(blocks)
    walk = np.cumsum(np.r_[1.0, np.full(blocks - 1, 300.0 / 3600.0)])  # variance of the random walk
    friction = np.minimum(*np.meshgrid(walk, walk))[np.ix_(of, of)]
    covariance = np.eye(count) + psi[:, :2] @ psi[:, :2].T
    covariance += friction * np.outer(psi[:, 2], psi[:, 2])
    r = np.linalg.cholesky(covariance) @ rng.standard_normal(count)
    if size is not None:
        r = r - size * psi[:, 3]  # innovations fall as the number grows
    rows = np.column_stack([r, psi])
    gram = np.array([rows[of == k].T @ rows[of == k] for k in range(blocks)])
    drive = Blocks(STATES, THETAS, begin, begin + 1.0, np.full(blocks, per_block), gram)
    return drive, rows, covariance, of


def test_residuals_are_the_innovations_of_the_whole_problem():
    blocks, rows, covariance, of = problem(1)
    result = recursive_residuals(blocks, FAULTS)
    for k in (0, 1, 5, 11):
        before, own = of < k, of == k
        gain = np.linalg.solve(covariance[np.ix_(before, before)], covariance[np.ix_(before, own)])
        e = rows[own, 0] - gain.T @ rows[before, 0]
        S = covariance[np.ix_(own, own)] - covariance[np.ix_(own, before)] @ gain
        trace = rows[own][:, 1 + np.array(FAULTS)]
        information = np.diag(trace.T @ np.linalg.solve(S, trace))
        z = -trace.T @ np.linalg.solve(S, e) / np.sqrt(information)
        assert result.z[k] == pytest.approx(z, abs=1e-8)
        assert result.information[k] == pytest.approx(information, rel=1e-8)
        assert result.chi_square[k] == pytest.approx(e @ np.linalg.solve(S, e), rel=1e-8)


@pytest.mark.parametrize("onset", [0, 5])
def test_scores_since_the_onset_are_those_of_all_readings(onset):
    blocks, rows, covariance, _ = problem(2, size=0.4, onset=onset)
    before = recursive_residuals(blocks, FAULTS).before
    result = onset_scores(blocks, FAULTS, before, onset, len(blocks))
    trace = rows[:, 1 + np.array(FAULTS)]
    weighted = np.linalg.solve(covariance, trace)
    assert result.information[-1] == pytest.approx(trace.T @ weighted, rel=1e-7, abs=1e-7)
    assert result.score[-1] == pytest.approx(-weighted.T @ rows[:, 0], rel=1e-7, abs=1e-7)


def test_healthy_residuals_are_white_and_of_variance_one():
    z = np.concatenate(
        [recursive_residuals(problem(seed)[0], FAULTS).z[:, 0] for seed in range(60)]
    )
    assert np.mean(z**2) == pytest.approx(1.0, abs=4 * np.sqrt(2 / len(z)))
    assert np.mean(z[1:] * z[:-1]) == pytest.approx(0.0, abs=4 / np.sqrt(len(z)))


def test_a_healthy_clutch_may_wear():
    thetas = (*THETAS, Unknown("wear", "rate", 0.5, gain=True, healthy=0.1))
    free, variance, per_hour = nuisances(thetas, STATES)
    assert free.tolist() == [0, 1, 2, 5]
    assert variance[-1] == pytest.approx(0.01)
    assert per_hour.tolist() == [0.0, 0.0, 1.0, 0.0]


def test_a_healthy_clutch_may_start_warm():
    thetas = (Unknown("start", "temp_body", 8.0, drive=0), Unknown("start", "friction", 0.02))
    _, variance, per_hour = nuisances(thetas, STATES)
    assert variance.tolist() == [(40.0 / 8.0) ** 2, 1.0]
    assert per_hour.tolist() == [0.0, 1.0]


def test_a_pause_or_its_length_ends_a_block():
    t = np.array([0.0, 1.0, 2.5, 5.5, 6.0, 20.0, 5.6])
    assert block_index(t).tolist() == [0, 0, 0, 1, 1, 2, 1]
