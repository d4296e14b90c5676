"""Inputs between their samples: integrals of what bends, against the exact ones."""

from __future__ import annotations

import numpy as np
import pytest

from clutchest.inference.input_interpolation import InterpolatedInput, spacing
from clutchest.signals import Floats

PERIOD, NOISE = 0.01, 0.02  # s, mm: those of a piston's position


def release_memory(t: Floats) -> Floats:
    """A pedal let go at 0.5 s: half a cosine of 7 mm in 120 ms."""
    return 3.5 * (1.0 - np.cos(np.pi * np.clip((t - 0.5) / 0.12, 0.0, 1.0)))


@pytest.mark.parametrize("phase", [0.0, 0.003, 0.005, 0.008])
def test_the_integral_is_that_of_the_curve(phase):
    """Whatever the phase of events between the samples, most of what lines lose until the turn is
    known."""
    own, t = np.arange(0.0, 1.0, PERIOD), np.arange(0.3, 0.56, PERIOD) + phase
    fine = np.linspace(t[0], t[-1], 200_001)
    exact = np.trapezoid(release_memory(fine), fine)
    lines = np.interp(t, own, release_memory(own))
    lost = np.trapezoid(lines, t) - exact
    left = lost - np.trapezoid(
        InterpolatedInput.of(own, release_memory(own), NOISE).off(t, spacing(t)), t
    )
    assert lost > 1e-4
    assert abs(left) < 0.2 * lost


def test_values_between_are_those_of_lines_less_their_bends():
    rng = np.random.default_rng(9)
    time = np.cumsum(rng.uniform(0.005, 0.015, 300))
    each = InterpolatedInput(time, rng.standard_normal(300), rng.standard_normal(300))
    t = np.sort(np.concatenate([rng.uniform(time[0] - 0.1, time[-1] + 0.1, 500), time[::7]]))
    wanted = np.interp(t, each.time, each.value) - each.off(t, spacing(t))
    np.testing.assert_allclose(each.at(t, spacing(t)), wanted, rtol=1e-9, atol=1e-12)


def test_noise_does_not_bend():
    """White noise bends no course, but for one sample in ten thousand."""
    rng, own = np.random.default_rng(0), np.arange(0.0, 200.0, PERIOD)
    course = InterpolatedInput.of(own, NOISE * rng.standard_normal(len(own)), NOISE)
    assert np.mean(course.bends != 0.0) < 3e-4


def test_a_parabola_is_met_everywhere():
    own = np.arange(0.0, 1.0, PERIOD)
    course = InterpolatedInput.of(own, 500.0 * own**2, 1e-6)
    t = np.arange(0.1, 0.9, 0.0037)
    np.testing.assert_allclose(course.at(t, np.zeros(len(t))), 500.0 * t**2, rtol=1e-9)


def test_nothing_bends_across_a_hole():
    own = np.array([0.0, 0.01, 0.02, 0.03, 0.5, 0.51, 0.52, 0.53, 0.54])
    value = np.where(own < 0.1, 0.0, 5.0)
    assert not InterpolatedInput.of(own, value, NOISE).bends[2:6].any()


def followed(read: Floats) -> InterpolatedInput:
    """As a voltage that a motor follows, white noise of 0.01 V in it."""
    return InterpolatedInput.at_samples(0.005 * np.arange(len(read)), read, 0.01, 0.0)


def test_the_noise_of_what_rests_is_told_and_little_is_left():
    noise = 0.01 * np.random.default_rng(3).standard_normal(4000)
    course = followed(4.8 + noise)
    assert np.std(course.shakes) == pytest.approx(0.01, rel=0.1)
    assert np.corrcoef(course.shakes, noise)[0, 1] > 0.9
    assert np.std(course.value - 4.8) < 0.0015


def test_noise_alone_never_turns_an_input():
    """In an hour at 200 Hz: where it did, a motor at rest was driven by noise as it is read."""
    time = np.arange(720_000) * 0.005
    read = NOISE * np.random.default_rng(11).standard_normal(len(time))
    each = InterpolatedInput.at_samples(time, read, NOISE, 0.0)
    assert np.all(each.at_rest != 0.0)


def test_what_moves_is_followed_as_it_is_read():
    t = 0.005 * np.arange(400)
    read = np.where(t < 1.0, 12.0, 12.0 - 3.0 * np.sin(60.0 * (t - 1.0)))
    moves = (t > 1.05) & (t < 1.95)
    course = followed(read + 0.01 * np.random.default_rng(4).standard_normal(len(t)))
    assert not course.shakes[moves].any()
    assert course.shakes[t < 0.9].any()


def test_at_rest_an_input_is_smoother_than_while_it_acts():
    t = np.arange(0.0, 10.0, 0.005)
    read = 1.0 + 0.01 * np.random.default_rng(4).standard_normal(len(t))
    course = InterpolatedInput.at_samples(t, read, 0.01, 0.0)
    acting, resting = read - course.shakes, read - course.at_rest
    assert np.std(np.diff(resting)) < 0.2 * np.std(np.diff(acting))
    assert np.std(resting) < 0.5 * np.std(acting)
