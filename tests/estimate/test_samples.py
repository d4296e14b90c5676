"""Noise of readings and inputs as it goes into the filter: variance of a reading, averaged or not,
and density of an input's noise."""

from __future__ import annotations

import numpy as np
import pytest

import clutchest
from clutchest.estimate.samples import readings_of, white_density
from clutchest.estimate.timeline import build
from clutchest.signals import Signal

PERIOD, NOISE = 0.01, 0.3


def sampled(value: np.ndarray) -> Signal:
    return Signal.of("", "", np.arange(len(value)) * PERIOD, value)


@pytest.mark.parametrize("ar", [0.0, 0.5, 0.9])
def test_an_unaveraged_reading_is_as_uncertain_as_its_noise_says(ar: float) -> None:
    """Autocorrelated noise repeats itself: over many readings the mean of AR(1) noise has
    (1 + ρ)/(1 − ρ) times the variance that white noise would leave."""
    readings = readings_of(sampled(np.arange(50.0)), NOISE, ar, 0.0)
    assert np.array_equal(readings.value, np.arange(50.0))
    assert readings.variance == pytest.approx(NOISE**2 * (1 + ar) / (1 - ar))
    rng, n, noise = np.random.default_rng(1), 2000, np.zeros((300, 2000))
    kicks = NOISE * np.sqrt(1 - ar**2) * rng.standard_normal(noise.shape)
    noise[:, 0] = NOISE * rng.standard_normal(300)
    for k in range(1, n):
        noise[:, k] = ar * noise[:, k - 1] + kicks[:, k]
    assert readings.variance[0] == pytest.approx(n * np.var(noise.mean(axis=1)), rel=0.35)


def test_an_average_of_a_repeated_reading_is_no_better_than_one() -> None:
    readings = readings_of(sampled(np.arange(60.0)), NOISE, 0.0, 0.1)
    assert readings.variance[readings.full] == pytest.approx(NOISE**2)


@pytest.mark.parametrize("ar", [0.0, 0.5])
def test_the_density_of_an_inputs_noise_is_that_of_its_integral(ar: float) -> None:
    """∫ of sampled noise over T s has the variance density · T."""
    assert white_density(NOISE, ar, PERIOD) == pytest.approx(
        NOISE**2 * PERIOD * (1 + ar) / (1 - ar)
    )


def test_the_timeline_has_the_noise_of_the_vehicle_file() -> None:
    truck = clutchest.load_vehicle("truck")
    signals = clutchest.simulate(truck, "launches", 1, duration=20.0)
    model = truck.machine.equations(set(signals))
    line = build(signals, truck, model, 10.0, {})
    torque = truck.signals["engine_torque"]
    density = torque.noise**2 * 0.01 * (1 + torque.noise_ar) / (1 - torque.noise_ar)
    assert line.noise[model.input("engine_torque")] == pytest.approx(density, rel=0.02)
    speed, read = truck.signals["engine_speed"], line.sensor == model.sensor("engine_speed")
    expected = speed.noise**2 * (1 + speed.noise_ar) / (1 - speed.noise_ar)
    assert line.R[read] == pytest.approx(expected)
