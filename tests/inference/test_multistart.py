"""Thresholds that some numbers pass and others do not."""

from __future__ import annotations

import numpy as np
import pytest

from clutchest.inference.map_fit import NO_SHAPES, Fitter, Look
from clutchest.inference.multistart import multistart

FREE = np.array([0, 1])
SLOPE = 20.0


class Cap(Fitter):
    """Two numbers of prior 0 ± 1: one is told by a reading, the other one shows only from
    ``threshold`` on, where a second reading says that it is ``truth``."""

    def __init__(self, threshold: float, truth: float) -> None:
        self.threshold, self.read = threshold, SLOPE * max(truth - threshold, 0.0)
        self.span, self.prior = None, np.ones(2)
        self.low, self.high = np.full(2, -np.inf), np.full(2, np.inf)

    def come(self, theta, shapes=NO_SHAPES):
        pass

    def look(self, theta, shapes=NO_SHAPES, active=None):
        past = theta[0] > self.threshold
        r = np.array([SLOPE * past * (theta[0] - self.threshold) - self.read, 10.0 * theta[1]])
        psi = np.diag([SLOPE * past, 10.0])
        return Look(theta, shapes, r, psi, float(r @ r + theta @ theta), ())


@pytest.mark.parametrize("side", [0.7, 1.2, 1.7])
def test_the_most_probable_place_is_found_past_a_threshold(side):
    cap = Cap(side, truth=1.9)
    here = cap.improve(cap.look(np.zeros(2)), FREE)
    np.testing.assert_allclose(here.theta, 0.0)  # the derivative is nought
    there = multistart(cap, here, FREE)
    assert there is not None
    assert there.theta[0] == pytest.approx(1.9, abs=0.05)
    assert there.cost < here.cost


def test_where_no_threshold_is_passed_there_is_no_other_place():
    for cap in (Cap(1.0, truth=0.0), Cap(-9.0, truth=0.5)):
        here = cap.improve(cap.look(np.zeros(2)), FREE)
        assert multistart(cap, here, FREE) is None
