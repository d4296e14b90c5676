"""What data want beside an effect, against noise and what no form is exact to: made-up data."""

from __future__ import annotations

import numpy as np
from scipy.stats import kstest

from clutchest.discovery.deviation import FormDeviation, deviation

READINGS, BLOCK = 2000, 50
BLOCKS = np.arange(READINGS) // BLOCK


def wanted(
    columns: np.ndarray, r: np.ndarray, *, inexact: float = 0.0, negligible: float = 0.0
) -> FormDeviation:
    gram = columns.T @ columns
    return deviation(columns, r, -columns.T @ r, gram, BLOCKS, negligible * gram, inexact)


def hats(strength: float) -> np.ndarray:
    """Derivatives of four coefficients that act at turns, together of this length."""
    columns = np.zeros((READINGS, 4))
    columns[np.arange(READINGS), np.arange(READINGS) % 4] = strength / np.sqrt(READINGS)
    return columns


def test_p_values_of_noise_are_uniform_but_for_what_correlates_in_blocks():
    random, columns = np.random.default_rng(1), hats(30.0)
    found = [wanted(columns, random.standard_normal(READINGS)) for _ in range(400)]
    assert {each.freedom for each in found} == {4}
    assert 0.45 < np.mean([each.p_value for each in found]) < 0.6
    assert np.mean([each.p_value < 0.05 for each in found]) < 0.08
    shared = np.repeat(random.standard_normal((400, READINGS // BLOCK)), BLOCK, axis=1)
    noisy = [wanted(columns, 0.5 * s + random.standard_normal(READINGS)) for s in shared]
    assert np.mean([each.p_value < 0.05 for each in noisy]) < 0.12, "blocks scatter more"


def test_a_share_of_the_effect_is_allowed_and_more_is_refuted():
    random, columns = np.random.default_rng(2), hats(2000.0)
    exact, allowed = [], []
    for _ in range(200):
        off = 0.01 * random.standard_normal(4)
        r = random.standard_normal(READINGS) - columns @ off
        exact.append(wanted(columns, r).p_value)
        allowed.append(wanted(columns, r, inexact=0.01).p_value)
    assert kstest(allowed, "uniform").pvalue > 0.01
    assert np.median(exact) < 1e-6, "noise alone does not explain one per cent"
    r = random.standard_normal(READINGS) - columns @ np.array([0.1, -0.1, 0.1, -0.1])
    assert wanted(columns, r, inexact=0.01).p_value < 1e-10


def test_directions_that_say_nothing_do_not_count():
    random = np.random.default_rng(3)
    r = random.standard_normal(READINGS)
    assert wanted(hats(1.0), r) == FormDeviation(0.0, 0, 1.0)
    columns = hats(30.0)
    columns[:, 3] = columns[:, 2] + 1e-2 * columns[:, 3]
    assert wanted(columns, r, negligible=1e-3).freedom == 3
    columns[:, 3] *= 1e3
    assert wanted(columns, r, negligible=1e-3).freedom == 3
