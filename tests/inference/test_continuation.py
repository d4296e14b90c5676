"""Numbers that steps left far off, and that are led home where that is better."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from clutchest.inference.continuation import continue_towards_prior
from clutchest.inference.map_fit import improve
from clutchest.inference.objective import Objective
from clutchest.inference.unknowns import UnknownGain, UnknownParameter
from clutchest.signals import Floats
from made_up import objective_of

FREE = np.array([0, 1])
NEAR = np.zeros(2)  # a fit that is where its priors are


def ripples(height: float, apart: float = 1.0, asked: float = 0.0) -> Objective:
    """A number of prior 0 ± 1 across which the floor of a valley has ripples, ``height`` in
    standard deviations, ``apart`` from each other; a reading says that another one, a gain, goes
    with its square."""

    def residuals(theta: Floats) -> tuple[Floats, Floats]:
        far, gain = theta
        phase = np.pi * (far - asked) / apart
        r = np.array([height * np.sin(phase), 10.0 * (gain - far**2)])
        bent = height * np.pi / apart * np.cos(phase)
        return r, np.array([[bent, 0.0], [-20.0 * far, 10.0]])

    gain = UnknownGain("gain", "size", 1.0, -np.inf, np.inf)
    return objective_of(residuals, (UnknownParameter("far", 1.0), gain))


@pytest.mark.parametrize("begin", [-8.0, 8.0, 12.0])
def test_a_number_held_up_on_its_way_is_led_home(begin):
    valley = ripples(8.0)
    held_up = improve(valley, valley.linearise_at(np.array([begin, begin**2])), FREE)
    assert abs(held_up.theta[0]) > abs(begin) - 0.5
    found = continue_towards_prior(valley, held_up, FREE, NEAR)
    np.testing.assert_allclose(found.theta, 0.0, atol=0.05)
    assert found.cost < 0.1 < held_up.cost


def test_what_lies_as_far_off_without_a_cause_is_not_led_home():
    valley = ripples(8.0)
    held_up = improve(valley, valley.linearise_at(np.array([8.0, 64.0])), FREE)
    assert continue_towards_prior(valley, held_up, FREE, np.array([8.0, 0.0])) is held_up


def test_what_the_data_ask_for_stays_where_it_is():
    valley = ripples(40.0, apart=60.0, asked=5.0)
    asked = improve(valley, valley.linearise_at(np.array([4.0, 16.0])), FREE)
    assert asked.theta[0] == pytest.approx(4.1, abs=0.2)
    assert continue_towards_prior(valley, asked, FREE, NEAR) is asked


def test_a_gain_has_no_home():
    valley = ripples(0.0)
    far = improve(valley, valley.linearise_at(np.array([0.0, 50.0])), FREE)
    valley = replace(valley, prior=np.zeros(2))
    large = valley.linearise_at(np.array([6.0, 36.0]))
    assert continue_towards_prior(valley, large, FREE, NEAR) is large
    assert continue_towards_prior(valley, far, np.zeros(0, int), NEAR) is far
