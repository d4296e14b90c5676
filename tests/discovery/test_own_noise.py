"""What passes for noise: fits in noise as they leave it, compared by the likelihood of both."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from clutchest.discovery import own_noise
from clutchest.discovery.search import free_of
from clutchest.discovery.segmentation import segmented
from clutchest.inference.fitted_gains import with_fitted_gains
from clutchest.inference.innovations import NO_DERIVATIVES
from clutchest.inference.map_fit import TURNS, settle
from clutchest.inference.objective import Objective
from clutchest.inference.problem import Problem
from clutchest.models.error_term_effects import error_term_effects
from clutchest.reading import read_log
from clutchest.simulated import simulate
from clutchest.vehicle import load_vehicle
from foreign_machines import module, vehicle


@pytest.fixture(scope="module")
def begin(tmp_path_factory) -> Objective:
    """Tanks that spill, which their textbook's model does not: what it leaves is slow and loud."""
    folder, car = tmp_path_factory.mktemp("tanks"), vehicle("tanks")
    module("tanks", "generate").generate(folder, seed=0, count=400)
    paths = module("tanks", "convert").convert(folder, folder)
    drives = segmented(read_log(paths[:1], car), car)
    objective = Objective.of(Problem.of(drives, car, tuple(car.machine.effects.values())))
    return objective.in_white_noise_of(objective.linearise_at(objective.problem.begin))


def test_numbers_and_noise_make_each_other_likelier(begin):
    theta = begin.problem.begin
    once, often = (own_noise._likelier(begin, (), theta, turns) for turns in (1, TURNS))
    assert often[0] < once[0] - own_noise.SLIGHT
    cost, objective, fit = often
    free = free_of(begin.problem, ())
    again = own_noise._likelier(objective.in_noise_of(fit), (), fit.theta, TURNS)
    assert again[0] > cost - 2.0 * own_noise.SLIGHT, "nothing is left to gain"
    np.testing.assert_array_equal(np.delete(fit.theta, free), np.delete(theta, free))


@pytest.mark.slow
def test_what_the_file_allows_for_is_no_loud_noise():
    """A torque curve that is a percent off heats the clutch: in white noise of the position, zero
    positions of a long drive are many times that off."""
    truck = load_vehicle("truck")
    white = replace(
        truck, signals={name: replace(s, noise_ar=0.0) for name, s in truck.signals.items()}
    )
    drive = simulate(
        white,
        "pulses",
        206,
        truck_seed=206,
        duration=1000.0,
        disturbances={"friction_std": 0.02, "torque_bias_std": 5.0},
    )
    effects = (*white.machine.effects.values(), *error_term_effects(white.machine))
    given = segmented(drive, white), white, effects, None
    problem = with_fitted_gains(Problem.of(*given, discrepant=True, input_noise=False))
    objective, fit = settle(Objective.of(problem), problem.begin)
    (drive,) = objective.linearise_at(fit.theta, active=NO_DERIVATIVES).raw
    (readings,) = (each.readings for each in problem.drives)
    names = [sensor.name for sensor in problem.compiled.model.sensors]
    zero = drive.r[readings.sensor == names.index("zero_position")]
    assert np.sqrt(np.mean(zero**2)) > own_noise.LOUD
    assert not own_noise.loud(fit, objective)
