"""Fault tests of the equations: thresholds at the stated false-alarm rate, detectable sizes."""

from dataclasses import replace
from math import log
from types import SimpleNamespace

import numpy as np
import pytest
from linear_drive import linear_drive
from scipy.stats import chi2

from clutchest.diagnosis.fault_tests import (
    LEAST,
    SCATTER,
    SHORTEST_H,
    mixture_ratio,
    run_fault_tests,
    surprise,
)
from clutchest.diagnosis.thresholds import glr_path, threshold
from clutchest.models import machine_of

FAULTS = {fault.name: fault for fault in machine_of("dry_clutch").faults}
MACHINE = SimpleNamespace(faults=(FAULTS["friction_level"], FAULTS["torque_gain"]), wear=None)
RATE = 10.0  # false alarms per 1000 h


@pytest.fixture(scope="module")
def results():
    drive, *_ = linear_drive(3, blocks=60)
    return run_fault_tests(drive, MACHINE, RATE, 2.0)


@pytest.mark.parametrize(("hours", "counted"), [(2.0, 2.0), (0.01, SHORTEST_H)])
def test_a_monitor_spends_its_false_alarms_on_two_tests(hours, counted):
    drive, *_ = linear_drive(3, blocks=20)
    results = run_fault_tests(drive, MACHINE, RATE, hours)
    chance = RATE * counted / 1000.0 / 2.0  # of either test within the drive
    for result in results.faults:
        assert result.was_at == pytest.approx(log(1.0 / chance))
    assert results.misfit_at == pytest.approx(log(len(drive) / (2.0 * chance)))


def test_the_threshold_of_an_onset_is_that_of_its_rate_per_block(results):
    blocks = len(results.blocks)
    for i, result in enumerate(results.faults):
        low = LEAST * result.fault.size / result.unit
        information = results.residuals.information[:, i]

        def glr(score, information, low=low):
            return glr_path(score, information, low, 1.0)[0]

        per_block = RATE * 2.0 / 1000.0 / 2.0 / blocks
        expected = threshold(glr, information, results.noise_model, per_block)
        assert result.begins_at == pytest.approx(expected)


@pytest.mark.parametrize("one_sided", [False, True])
def test_healthy_drives_exceed_the_mixture_as_seldom_as_ville_says(one_sided):
    rng, alpha, drives = np.random.default_rng(9), 0.05, 4000
    information = np.cumsum(np.full((drives, 200), 0.3), axis=1)
    score = np.cumsum(np.sqrt(0.3) * rng.standard_normal((drives, 200)), axis=1)
    ratio = mixture_ratio(score, information, one_sided)
    share = np.mean(ratio.max(axis=1) > log(1.0 / alpha))
    assert 0.3 * alpha < share <= alpha


def test_half_of_the_drives_detect_the_detectable_size(results):
    """By the test of presence from the start: its mean statistic reaches the threshold there."""
    for result in results.faults:
        assert result.needed == pytest.approx(result.d_prime * result.detectable / result.unit)
        assert result.needed**2 / 2.0 == pytest.approx(
            min(result.begins_at, result.was_at + log(2.0))
        )


def test_a_fault_is_detected_and_a_healthy_drive_is_not(results):
    assert {result.status for result in results.faults} == {"passed"}
    assert results.misfit_detected is None
    drive, *_ = linear_drive(3, size=1.0, onset=20, blocks=60)
    faulty = run_fault_tests(drive, MACHINE, RATE, 2.0).faults[0]
    assert faulty.status == "failed"
    assert faulty.detected >= 20
    assert abs(faulty.onset[faulty.detected] - 20) <= 5
    assert faulty.excess > 0.0


def test_a_block_that_no_fault_explains_is_a_misfit(results):
    drive, *_ = linear_drive(3, blocks=60)
    gram = drive.gram.copy()
    gram[40, 0, 0] += chi2.isf(1e-12, drive.count[40])
    odd = run_fault_tests(replace(drive, gram=gram), MACHINE, RATE, 2.0)
    assert odd.misfit_detected == 40
    assert not any(result.status == "failed" for result in odd.faults)


@pytest.mark.parametrize("count", [50, 500, 5000])
def test_a_level_that_scatters_is_no_misfit(count):
    """Blocks of healthy noise whose level differs a little exceed a p-value about as often as it
    says, which long ones taken for exact would not; a level 1.4 times as high is seen in them."""
    rng, alpha, blocks = np.random.default_rng(3), 1e-3, 400_000
    level = 1.0 + SCATTER * rng.standard_normal(blocks)
    ratio = level * rng.chisquare(count, blocks) / count
    share = np.mean(surprise(ratio, np.full(blocks, count)) > -np.log(alpha))
    assert 0.5 * alpha < share < 1.5 * alpha
    if count == 5000:
        assert np.mean(chi2.sf(ratio * count, count) < alpha) > 10 * alpha
        assert surprise(np.array([1.4]), np.array([count]))[0] > 15.0
