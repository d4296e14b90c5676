"""What passes for noise: fits in noise as they leave it, compared by the likelihood of both."""

from __future__ import annotations

import numpy as np
import pytest

from clutchest.discovery import own_noise
from clutchest.discovery.search import free_of
from clutchest.discovery.segmentation import segmented
from clutchest.inference.map_fit import TURNS
from clutchest.inference.objective import Objective
from clutchest.inference.problem import Problem
from clutchest.reading import read_log
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
