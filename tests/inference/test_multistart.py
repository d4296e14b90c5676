"""Thresholds that some numbers pass and others do not."""

from __future__ import annotations

import numpy as np
import pytest

from clutchest.inference.map_fit import improve
from clutchest.inference.multistart import multistart
from clutchest.inference.objective import Objective
from clutchest.inference.unknowns import UnknownParameter
from clutchest.signals import Floats
from made_up import objective_of

FREE = np.array([0, 1])
SLOPE = 20.0


def cap(threshold: float, truth: float) -> Objective:
    """Two numbers of prior 0 ± 1: one is determined by a reading, the other one shows only from
    ``threshold`` on, where a second reading says that it is ``truth``."""
    read = SLOPE * max(truth - threshold, 0.0)

    def residuals(theta: Floats) -> tuple[Floats, Floats]:
        past = theta[0] > threshold
        r = np.array([SLOPE * past * (theta[0] - threshold) - read, 10.0 * theta[1]])
        return r, np.diag([SLOPE * past, 10.0])

    return objective_of(residuals, (UnknownParameter("late", 1.0), UnknownParameter("read", 1.0)))


@pytest.mark.parametrize("side", [0.7, 1.2, 1.7])
def test_the_most_probable_place_is_found_past_a_threshold(side):
    objective = cap(side, truth=1.9)
    here = improve(objective, objective.linearise_at(np.zeros(2)), FREE)
    np.testing.assert_allclose(here.theta, 0.0)  # the derivative is nought
    there = multistart(objective, here, FREE)
    assert there is not None
    assert there.theta[0] == pytest.approx(1.9, abs=0.05)
    assert there.cost < here.cost


def test_where_no_threshold_is_passed_there_is_no_other_place():
    for objective in (cap(1.0, truth=0.0), cap(-9.0, truth=0.5)):
        here = improve(objective, objective.linearise_at(np.zeros(2)), FREE)
        assert multistart(objective, here, FREE) is None
