"""Noise of an input must not pass for information of a parameter that multiplies it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from clutchest.estimate.replay import replay
from clutchest.simulated import simulate
from clutchest.vehicle import load_vehicle


def test_noise_of_the_reported_torque_does_not_move_friction() -> None:
    """Nominal trucks under a torque report of fast noise: taken from the report itself, the
    answer to the inertia moved friction by one stated standard deviation, always downwards."""
    truck = load_vehicle("truck")
    coloured = replace(truck.signals["engine_torque"], noise_ar=0.5)
    truck = replace(truck, signals={**truck.signals, "engine_torque": coloured})
    off = []
    for seed in range(3):
        track = replay(simulate(truck, "heating", seed, duration=300.0, nominal=True), truck)
        friction = track.tracks[0].states["friction"]
        late = track.tracks[0].time > 150.0  # the first pulses are over
        off.append(np.mean((friction.value[late] - 1.0) / friction.std[late]))
    assert abs(np.mean(off)) < 0.5
