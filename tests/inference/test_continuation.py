"""Numbers that steps left far off, and that are led home where that is better."""

from __future__ import annotations

import numpy as np
import pytest

from clutchest.inference.continuation import continue_towards_prior
from clutchest.inference.map_fit import NO_SHAPES, Fitter, Look

FREE = np.array([0, 1])


class Ripples(Fitter):
    """A number of prior 0 ± 1 across which the floor of a valley has ripples, ``height`` in
    standard deviations, ``apart`` from each other; a reading says that another one, a gain, goes
    with its square."""

    def __init__(self, height: float, apart: float = 1.0, asked: float = 0.0) -> None:
        self.height, self.apart, self.asked = height, apart, asked
        self.span, self.prior = None, np.array([1.0, 0.0])
        self.low, self.high = np.full(2, -np.inf), np.full(2, np.inf)

    def come(self, theta, shapes=NO_SHAPES):
        pass

    def look(self, theta, shapes=NO_SHAPES, active=None):
        far, gain = theta
        phase = np.pi * (far - self.asked) / self.apart
        r = np.array([self.height * np.sin(phase), 10.0 * (gain - far**2)])
        bent = self.height * np.pi / self.apart * np.cos(phase)
        psi = np.array([[bent, 0.0], [-20.0 * far, 10.0]])
        return Look(theta, shapes, r, psi, float(r @ r + far**2), ())


@pytest.mark.parametrize("begin", [-8.0, 8.0, 12.0])
def test_a_number_held_up_on_its_way_is_led_home(begin):
    valley = Ripples(8.0)
    held_up = valley.improve(valley.look(np.array([begin, begin**2])), FREE)
    assert abs(held_up.theta[0]) > abs(begin) - 0.5
    found = continue_towards_prior(valley, held_up, FREE)
    np.testing.assert_allclose(found.theta, 0.0, atol=0.05)
    assert found.cost < 0.1 < held_up.cost


def test_what_the_data_ask_for_stays_where_it_is():
    valley = Ripples(40.0, apart=60.0, asked=5.0)
    asked = valley.improve(valley.look(np.array([4.0, 16.0])), FREE)
    assert asked.theta[0] == pytest.approx(4.1, abs=0.2)
    assert continue_towards_prior(valley, asked, FREE) is asked


def test_a_gain_has_no_home():
    valley = Ripples(0.0)
    far = valley.improve(valley.look(np.array([0.0, 50.0])), FREE)
    valley.prior[:] = 0.0
    large = valley.look(np.array([6.0, 36.0]))
    assert continue_towards_prior(valley, large, FREE) is large
    assert continue_towards_prior(valley, far, np.zeros(0, int)) is far
