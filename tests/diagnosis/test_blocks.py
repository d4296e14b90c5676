"""Blocks of simulated drives: noise level, nuisances and outliers."""

from dataclasses import replace

import numpy as np
import pytest

import clutchest
from clutchest.diagnosis.blocks import blocks_at, problem_of
from clutchest.diagnosis.drive_diagnosis import effects_for
from clutchest.diagnosis.recursive_residuals import nuisances, recursive_residuals

TRUCK = clutchest.load_vehicle("truck")


def city(effects=None):
    return clutchest.simulate(TRUCK, "city", 5, effects, duration=120.0)


def blocks(signals):
    return blocks_at(problem_of(signals, TRUCK, effects_for(TRUCK.machine)))


@pytest.fixture(scope="module")
def clean():
    return blocks(city())


def test_a_healthy_drive_is_predicted_to_within_its_noise(clean):
    result = recursive_residuals(clean, [])
    assert result.chi_square.sum() / clean.count.sum() == pytest.approx(1.0, abs=0.1)


def test_innovations_are_those_at_the_nominal_vehicle():
    """A bias of three prior standard deviations is in the blocks, though the operating point, at
    which the equations were linearised, has taken it up."""
    drive = blocks(city({"torque_bias": {"bias": 15.0}}))
    free, variance, _ = nuisances(drive.thetas, drive.states)
    gram, n = drive.gram.sum(axis=0), 1 + free
    mean = -np.linalg.solve(np.diag(1.0 / variance) + gram[np.ix_(n, n)], gram[n, 0])
    thetas = [str(drive.thetas[i]) for i in free]
    assert mean[thetas.index("start of torque_bias")] == pytest.approx(3.0, abs=0.5)


def test_outliers_do_not_count(clean):
    signals = city()
    track = clutchest.replay(signals, TRUCK).tracks[0]
    retracted = track.time[track.mode == track.mode_names.index("retracted")]
    position = signals["slave_position"]
    value = position.value.copy()
    first = np.searchsorted(position.time, retracted[len(retracted) // 2])
    value[first : first + 3] += 0.1  # ten standard deviations
    wrong = replace(position, value=value)
    spiked = blocks(replace(signals, signals={**signals.signals, "slave_position": wrong}))
    before, after = (recursive_residuals(drive, []).chi_square for drive in (clean, spiked))
    assert np.max(after - before) < 20.0
