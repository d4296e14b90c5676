"""Samples that are far off, and those that only look like it."""

from __future__ import annotations

import numpy as np
import pytest

from clutchest.estimate.outliers import without_spikes
from clutchest.signals import Floats, Signal
from clutchest.simulated import simulate
from clutchest.vehicle import load_vehicle

TIME = np.arange(0.0, 20.0, 0.01)
NOISE = 0.1


def signal(value: Floats) -> Signal:
    return Signal.of("engine_torque", "Nm", TIME, value)


def rough(seed: int) -> Floats:
    return NOISE * np.random.default_rng(seed).standard_normal(len(TIME))


@pytest.mark.parametrize("seed", range(5))
def test_what_is_far_off_is_left_out(seed: int) -> None:
    random = np.random.default_rng(seed)
    value, far = rough(seed), np.arange(10, len(TIME) - 10, 50)
    value[far] += NOISE * random.uniform(12.0, 20.0, len(far)) * random.choice([-1, 1], len(far))
    kept, count = without_spikes(signal(value), NOISE)
    assert count == len(far)
    assert not np.isin(TIME[far], kept.time).any()
    assert len(kept) == len(TIME) - count


def test_a_few_standard_deviations_beyond_the_limit_are_seen() -> None:
    """The limit is that of the stated noise, not one that its own roughness raises."""
    seen = expected = 0
    for seed in range(10):
        random = np.random.default_rng(100 + seed)
        value, far = rough(seed), np.arange(10, len(TIME) - 10, 50)
        value[far] += NOISE * random.uniform(8.0, 12.0, len(far)) * random.choice([-1, 1], len(far))
        seen += without_spikes(signal(value), NOISE)[1]
        expected += len(far)
    assert seen >= 0.9 * expected


@pytest.mark.parametrize(
    "course",
    [
        np.where(TIME > 10.0, 500.0, 0.0),
        4000.0 * TIME,
        300.0 * np.sin(2 * np.pi * 2.0 * TIME),
        np.where((TIME > 10.0) & (TIME < 10.025), 50.0, 0.0),
        100.0 * np.sin(2 * np.pi * 13.0 * TIME),
        500.0 * np.exp(-(TIME % 2.0) * 5.0) * np.cos(2 * np.pi * 8.0 * (TIME % 2.0)),
    ],
    ids=["a step", "a ramp", "a swing", "a peak of two samples", "a fast swing", "ringing"],
)
def test_a_transient_stays(course: Floats) -> None:
    for seed in range(10):
        kept, count = without_spikes(signal(course + rough(seed)), NOISE)
        assert count == 0
        assert len(kept) == len(TIME)


def test_noise_larger_than_stated_is_no_spike() -> None:
    _, count = without_spikes(signal(20 * rough(1)), NOISE)
    assert count <= 2  # of two thousand


def test_across_a_gap_anything_may_happen() -> None:
    time = np.concatenate([TIME[:900], [9.5], TIME[1000:]])
    value = np.zeros(len(time))
    value[900] = 100.0
    assert without_spikes(Signal.of("x", "Nm", time, value), NOISE)[1] == 0


def test_no_stated_noise_leaves_everything() -> None:
    value = rough(2)
    value[500] = 1e3
    assert without_spikes(signal(value), 0.0)[1] == 0
    assert without_spikes(Signal.of("x", "Nm", [0.0], [1.0]), 1.0)[1] == 0


@pytest.mark.parametrize("scenario", ["rig-steps", "slip-oil-sweep", "I5", "I8"])
def test_real_samples_of_a_fast_machine_stay(scenario: str) -> None:
    """The differential's rig turns round within some samples, thousands of times its noise."""
    vehicle = load_vehicle("alsd_rig")
    drive = simulate(vehicle, scenario, 1, duration=9.0)
    for name, drawn in drive.items():
        _, count = without_spikes(drawn, vehicle.signals[name].noise)
        assert count == 0, name
