"""Gains by which states are tracked, where those at the file's numbers belong to another motion."""

from __future__ import annotations

import numpy as np
import pytest

import clutchest
from clutchest.inference.fitted_gains import with_fitted_gains
from clutchest.inference.innovations import NO_DERIVATIVES
from clutchest.inference.map_fit import settle
from clutchest.inference.objective import Objective
from clutchest.inference.preparation import at_file, with_gains_at
from clutchest.inference.problem import Problem


@pytest.fixture(scope="module")
def rig() -> Problem:
    """Steps, of a specimen that is unlike the file."""
    signals = clutchest.simulate("alsd_rig", "rig-steps", 5, duration=14.0)
    return Problem.of(signals, clutchest.load_vehicle("alsd_rig"), ())


def _innovations(problem: Problem, theta: np.ndarray) -> np.ndarray:
    return problem.linearise(theta, {}, NO_DERIVATIVES)[0].r


def test_a_machine_of_which_nothing_is_tracked_throughout_is_left_as_it_is():
    truck = clutchest.load_vehicle("truck")
    given = clutchest.simulate(truck, "launches", 1, duration=30.0), truck, ()
    problem, fitted = Problem.of(*given), with_fitted_gains(Problem.of(*given, input_noise=False))
    assert not fitted.near.any() and not fitted.begin.any()
    (known,), (own,) = problem.drives, fitted.drives
    assert known.readings.input_noise.any()
    np.testing.assert_array_equal(own.readings.input_noise, known.readings.input_noise)
    np.testing.assert_array_equal(own.gains.gain, known.gains.gain)


@pytest.mark.slow
def test_gains_at_the_files_numbers_are_those_of_the_prepared_drive(rig):
    again = rig.with_gains_at(rig.near).drives[0]
    np.testing.assert_allclose(again.gains.gain, rig.drives[0].gains.gain, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(again.readings.std, rig.drives[0].readings.std, rtol=1e-9)


@pytest.mark.slow
def test_gains_are_those_of_the_numbers_near_which_fits_begin(rig):
    fitted = with_fitted_gains(rig)
    assert np.abs(fitted.near[rig.nuisances]).max() > 0.5
    own = rig.with_gains_at(fitted.near)
    np.testing.assert_allclose(own.drives[0].gains.gain, fitted.drives[0].gains.gain, atol=1e-6)


@pytest.mark.slow
def test_where_the_filter_runs_away_gains_stay(rig):
    """A motor of negative inertia does."""
    drive, there = rig.drives[0], at_file(rig.drives[0])
    keys = [parameter.key for parameter in rig.compiled.model.parameters]
    parameters = there.parameters.copy()
    parameters[keys.index("motor_inertia")] *= -1.0
    assert with_gains_at(drive, there._replace(parameters=parameters)) is drive


@pytest.mark.slow
def test_slow_ramps_in_which_a_motor_creeps_are_fitted():
    """With gains at the file's numbers, at which it sticks, no fit of these ended."""
    signals = clutchest.simulate("alsd_rig", "rig-ramps", 901, duration=60.0)
    problem = with_fitted_gains(Problem.of(signals, clutchest.load_vehicle("alsd_rig"), ()))
    _, fit = settle(Objective.of(problem), problem.near)
    assert np.mean(_innovations(problem, fit.theta) ** 2) < 1.5


@pytest.mark.slow
def test_a_part_whose_fit_ends_beyond_any_specimen_is_passed_over():
    """A sixteenth of this run, of one engagement, is fitted best by a negative static friction."""
    signals = clutchest.simulate("alsd_rig", "rig-slow", 1003, duration=60.0)
    problem = Problem.of(signals, clutchest.load_vehicle("alsd_rig"), ())
    near = with_fitted_gains(problem).near
    assert 0.5 < np.abs(near[problem.nuisances]).max() < 6.0


@pytest.mark.slow
def test_a_motor_that_begins_to_stick_and_slip_late_is_fitted():
    """From numbers of the first quarter of this run the whole is another motion, which a Stribeck
    speed 8 spreads off made the best of."""
    signals = clutchest.simulate("alsd_rig", "rig-ramps", 914, duration=60.0)
    problem = with_fitted_gains(Problem.of(signals, clutchest.load_vehicle("alsd_rig"), ()))
    assert np.abs(problem.begin[problem.nuisances]).max() < 5.0


@pytest.mark.slow
def test_a_cause_that_acts_like_numbers_far_off_is_followed():
    """Twice the friction is ten spreads off, and with gains at the file's numbers no fit of the
    whole ends."""
    hidden = {"motor_friction": {"change": 1.0}}
    signals = clutchest.simulate("alsd_rig", "rig-ramps", 931, effects=hidden, duration=60.0)
    problem = with_fitted_gains(Problem.of(signals, clutchest.load_vehicle("alsd_rig"), ()))
    assert np.abs(problem.near[problem.nuisances]).max() > 6.0
    assert np.mean(_innovations(problem, problem.begin) ** 2) < 1.2
