"""Signals that do not follow their own noise."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter, savgol_filter

from clutchest.inference.denoising import (
    BRIEF,
    CALM,
    GRID,
    REACH,
    _lines,
    _smooth,
    adaptive_mean,
    deadband,
    deadband_of_mean,
    denoised_rate,
    mean_of_slow,
)

T = np.arange(0.0, 60.0, 0.01)
ALWAYS = np.ones(len(T), bool)


def trapezium() -> np.ndarray:
    """Rest, a ramp of 40 a second, rest, and back."""
    return np.interp(T, [0.0, 20.0, 21.0, 40.0, 41.0, 60.0], [5.0, 5.0, 45.0, 45.0, 5.0, 5.0])


def coloured(rng: np.random.Generator, ar: float) -> np.ndarray:
    """Noise of variance 1."""
    return lfilter([np.sqrt(1.0 - ar**2)], [1.0, -ar], rng.normal(size=len(T)))


@pytest.mark.parametrize("count", [3, 5, 41, 399])
def test_lines_through_many_samples_are_those_of_least_squares(count):
    read = 300.0 + np.random.default_rng(count).standard_normal(400).cumsum()
    np.testing.assert_allclose(_lines(read, count), savgol_filter(read, count, 1), rtol=1e-12)


@pytest.mark.parametrize("rate", [0, 1])
def test_parabolas_are_those_of_least_squares_at_the_ends_too(rate):
    t = GRID * np.arange(200)
    value = np.random.default_rng(rate).standard_normal(200).cumsum()
    grid = np.arange(t[0], t[-1], GRID)
    wanted = savgol_filter(np.interp(grid, t, value), 21, 2, deriv=rate, delta=GRID)
    np.testing.assert_allclose(
        _smooth(t, value, 0.2, rate), np.interp(t, grid, wanted), rtol=1e-9, atol=1e-9
    )


def test_without_noise_nothing_changes():
    np.testing.assert_allclose(deadband(T, trapezium(), ALWAYS), trapezium(), atol=1e-9)


@pytest.mark.parametrize("ar", [0.0, 0.5, 0.9])
def test_noise_hardly_moves_it(ar):
    """A curve over it would otherwise have the noise for a driver."""
    rng = np.random.default_rng(1)
    moved = []
    for _ in range(20):
        held = deadband(T, 5.0 + coloured(rng, ar), ALWAYS)
        moved.append(np.mean(np.diff(held) != 0.0))
    assert np.mean(moved) < 0.03


@pytest.mark.parametrize("ar", [0.0, 0.9])
def test_it_goes_where_the_signal_goes(ar):
    noise = coloured(np.random.default_rng(2), ar)
    held = deadband(T, trapezium() + 0.5 * noise, ALWAYS)
    assert np.abs(held - trapezium()).max() < 0.5 * 4.5 * REACH
    assert abs(held[2050] - 25.0) < 0.5 * 3.0 * REACH


def test_it_is_the_noise_where_the_signal_matters_that_counts():
    noise = coloured(np.random.default_rng(3), 0.0) * (T < 30.0)
    quiet = T >= 30.0
    np.testing.assert_allclose(
        deadband(T, noise + trapezium(), quiet)[quiet], trapezium()[quiet], atol=1e-6
    )


@pytest.mark.parametrize("ar", [0.0, 0.9])
def test_what_is_dragged_along_travels_less_than_the_reading_at_rest(ar):
    noise = coloured(np.random.default_rng(4), ar)
    follows = adaptive_mean(T, 5.0 + noise, 1.0, ar)
    assert np.abs(np.diff(follows)).sum() < 0.2 * np.abs(np.diff(noise)).sum()


@pytest.mark.parametrize("ar", [0.0, 0.5])
def test_a_play_below_the_noise_hangs_back_where_the_plate_does(ar):
    """Slow creep to and fro by less than the noise, between moves of thousands of it."""
    creeps = 4.0 * np.sin(2.0 * np.pi * T / 12.0) + 3000.0 * (np.abs(T - 30.0) < 2.0)
    hangs = lag(creeps, 0.8)
    seen = [
        lag(adaptive_mean(T, creeps + coloured(rng, ar), 1.0, ar), 0.8) @ hangs / (hangs @ hangs)
        for rng in np.random.default_rng(5).spawn(10)
    ]
    read = [
        lag(creeps + coloured(rng, ar), 0.8) @ hangs / (hangs @ hangs)
        for rng in np.random.default_rng(5).spawn(10)
    ]
    assert np.mean(seen) > 0.9 > 0.7 > np.mean(read)


@pytest.mark.parametrize("ar", [0.0, 0.9])
def test_a_play_of_nothing_hangs_back_where_a_small_one_does(ar):
    """Where the plate is held, it stays hung back; what noise leaves in the path would turn it."""
    hangs = lag(trapezium(), 1e-6)
    alike: dict[str, list[float]] = {"path": [], "firm": []}
    for rng in np.random.default_rng(7).spawn(10):
        read = trapezium() + 0.1 * coloured(rng, ar)
        follows = adaptive_mean(T, read, 0.1, ar)
        for name, moves in (
            ("path", follows),
            ("firm", deadband_of_mean(T, read, follows, ALWAYS, 0.1, ar)),
        ):
            alike[name].append(np.mean(lag(moves, 1e-6) * hangs) / np.mean(hangs**2))
    assert np.mean(alike["firm"]) > np.mean(alike["path"]) + 0.1
    assert np.mean(alike["firm"]) > 0.8


def test_a_path_without_noise_is_firm():
    """Whatever the vehicle file says of the sensor."""
    follows = adaptive_mean(T, trapezium(), 0.1, 0.0)
    firmer = deadband_of_mean(T, trapezium(), follows, ALWAYS, 0.1, 0.0)
    np.testing.assert_allclose(firmer, follows, atol=1e-9)


def lag(x: np.ndarray, play: float) -> np.ndarray:
    """By how much what ``x`` drags along with this play is behind it."""
    behind = np.zeros(len(x))
    for k in range(1, len(x)):
        behind[k] = np.clip(behind[k - 1] - (x[k] - x[k - 1]), -play, play)
    return behind


def test_a_path_turns_where_the_signal_turns():
    noise = 0.1 * coloured(np.random.default_rng(6), 0.0)
    follows = adaptive_mean(T, trapezium() + noise, 0.1, 0.0)
    assert np.abs(follows - trapezium()).max() < 5.0 * 0.1  # a mean over 1.6 s is off by 8


def test_a_path_without_noise_is_the_reading():
    np.testing.assert_array_equal(adaptive_mean(T, trapezium(), 0.0, 0.0), trapezium())
    np.testing.assert_array_equal(adaptive_mean(T[:1], T[:1], 1.0, 0.0), T[:1])


def test_short_pulses_are_no_more_noise_than_the_sensor_has():
    pulses = 100.0 * np.clip(1.5 * np.sin(np.pi * T), -1.0, 1.0)
    noisy = pulses + np.random.default_rng(5).normal(size=len(T))

    def share(**options: float) -> float:
        """Of the pulses that is left, by regression."""
        left = deadband(T, noisy, ALWAYS, narrow=0.6, wide=1.2, **options)
        return float(left @ pulses / (pulses @ pulses))

    assert share() < 0.6  # much of them passes for noise
    assert share(most=1.0) > 0.9


def test_a_pace_is_that_of_a_signal_and_none_of_its_noise():
    rising = 5.0 * np.clip(T - 2.0, 0.0, 1.0)
    noisy = rising + 0.001 * np.random.default_rng(7).normal(size=len(T))
    found = denoised_rate(T, noisy, ALWAYS)
    inside = (T > 2.1) & (T < 2.9)
    np.testing.assert_allclose(found[inside], 5.0, atol=0.7)
    assert np.mean(found[(T < 1.8) | (T > 3.2)] == 0.0) > 0.95


def test_over_longer_a_slow_rate_leaves_its_noise():
    """Slip that grows by 6 rad/s², read with the noise of two speeds."""
    noisy = 6.0 * T + 0.08 * np.random.default_rng(5).standard_normal(len(T))
    brief, calm = (denoised_rate(T, noisy, ALWAYS, over) for over in (BRIEF[:1], CALM))
    assert np.median(brief) < 2.0 and np.median(calm) > 4.0


def test_a_rate_is_taken_over_as_little_as_noise_allows():
    wave, noise = np.sin(20.0 * T), np.random.default_rng(6).standard_normal(len(T))
    fine, coarse = wave + 1e-3 * noise, wave + 0.05 * noise
    for read, windows in ((fine, BRIEF[:1]), (coarse, BRIEF[1:])):
        np.testing.assert_array_equal(
            denoised_rate(T, read, ALWAYS), denoised_rate(T, read, ALWAYS, windows)
        )


def test_events_at_one_instant_have_no_pace():
    t = np.array([0.0, 0.01, 0.01, 0.02])
    assert not denoised_rate(t, np.arange(4.0), np.ones(4, bool)).any()


@pytest.mark.parametrize("period", [0.02, 0.034, 0.05, 0.1, 0.5])
def test_a_slow_signal_has_a_path_too(period):
    t = np.arange(0.0, 60.0, period)
    true = np.interp(t, T, trapezium())
    read = true + 0.1 * np.random.default_rng(3).normal(size=len(t))
    np.testing.assert_allclose(
        adaptive_mean(t, read, 0.1, 0.0), true, atol=0.5 + 40.0 * period / 3.0
    )


def test_a_slow_signal_is_averaged_over_as_many_samples():
    rng = np.random.default_rng(7)
    t = np.arange(0.37, 600.0, 1.0)
    mean = mean_of_slow(t, 30.0 + 0.5 * rng.normal(size=len(t)), 0.5, 0.0)
    assert np.sqrt(np.mean((mean - 30.0) ** 2)) < 0.5 / 4.0
    turns = 30.0 + 0.1 * np.maximum(t - 300.0, 0.0)
    np.testing.assert_allclose(mean_of_slow(t, turns, 0.5, 0.0), turns, atol=2.0 * 0.5)
