"""The interval of a gain on held-out drives that have decided whether it is told."""

from __future__ import annotations

import numpy as np
import pytest

from clutchest.discovery.result import Gain
from clutchest.discovery.selected_gain import given_above

STD = 3.0


def gain(total: float) -> Gain:
    interval = total - 1.96 * STD, total + 1.96 * STD
    return Gain(1.0, 1.0, total, 0.0, None, None, interval)


def test_a_result_that_the_log_alone_establishes_keeps_its_interval():
    assert given_above(gain(2.0), -np.inf) == gain(2.0)


def test_far_above_what_decides_the_interval_is_the_plain_one():
    np.testing.assert_allclose(given_above(gain(30.0), 1.0).ci95, gain(30.0).ci95, rtol=1e-3)


def test_just_above_what_decides_the_gain_may_as_well_be_a_loss():
    low, high = given_above(gain(1.1), 1.0).ci95
    assert low < gain(1.1).ci95[0] < 0.0
    assert high < gain(1.1).ci95[1]


@pytest.mark.parametrize("true", [-4.0, 0.0, 4.0])
def test_of_gains_that_are_told_the_true_one_lies_inside_as_often_as_is_said(true):
    """Where nothing is gained, plain intervals hold the truth too seldom."""
    least, rng = 3.0, np.random.default_rng(5)
    drawn = [gain(total) for total in rng.normal(true, STD, 8000) if total >= least]
    told = drawn[:400]
    allowing = [given_above(one, least) for one in told]
    inside, plain = (
        np.mean([low <= true <= high for low, high in (one.ci95 for one in each)])
        for each in (allowing, told)
    )
    assert len(told) > 60
    assert abs(inside - 0.95) < 3.0 * np.sqrt(0.95 * 0.05 / len(told))
    assert plain < 0.1 or true > -4.0
