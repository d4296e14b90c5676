"""Gains that begin within a drive."""

import numpy as np
import pytest

import clutchest
from clutchest.inference.later_gains import beginning_at, from_the_start
from clutchest.inference.objective import Objective
from clutchest.inference.problem import Problem
from clutchest.models import machine_of

ONSET = 60.0  # s
FAULTS = {f.name: f for f in machine_of("dry_clutch").faults}
NAMES = {"friction_level": "friction_level.change", "drift:slave_position": "position_drift.rate"}


@pytest.fixture(scope="module")
def problem():
    truck = clutchest.load_vehicle("truck")
    signals = clutchest.simulate(truck, "city", 4, duration=150.0)
    return Problem.of(signals, truck, [FAULTS[name].effect for name in NAMES])


@pytest.mark.parametrize("name", NAMES)
def test_derivatives_are_those_of_the_innovations_and_0_before(problem, name):
    gain = problem.index(NAMES[name])
    later = beginning_at(problem, gain, ONSET, grows=bool(FAULTS[name].grows_as))
    theta = np.zeros(len(problem.thetas))
    small = 1e-3 * np.eye(len(theta))[gain]
    [at] = later.linearise(theta, {})
    [up], [down] = (later.linearise(theta + sign * small, {}) for sign in (1.0, -1.0))
    by_difference = (up.r - down.r) / 2e-3
    error = np.linalg.norm(at.psi[:, gain] - by_difference)
    assert error < 0.02 * np.linalg.norm(by_difference)
    before = problem.drives[0].readings.t < ONSET
    assert np.all(at.psi[before, gain] == 0.0) and np.any(at.psi[~before, gain] != 0.0)


@pytest.mark.parametrize("name", NAMES)
def test_the_same_gain_from_the_start_on_is_what_it_was(problem, name):
    gain, theta = problem.index(NAMES[name]), np.zeros(len(problem.thetas))
    later = beginning_at(problem, gain, ONSET)
    [always] = Objective.of(problem).linearise_at(theta).raw
    by = from_the_start(later, Objective.of(later).linearise_at(theta), gain)
    assert by[:, 0] == pytest.approx(always.psi[:, gain], rel=1e-6, abs=1e-9)
