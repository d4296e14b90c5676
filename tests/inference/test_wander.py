"""How far states wander: what is stated, and the sines that make a walk."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import clutchest
from clutchest.inference.problem import Problem
from clutchest.inference.wander import random_walk
from clutchest.models import machine_of
from clutchest.models.model import Model
from clutchest.vehicle import Estimation, Vehicle
from clutchest.vehicle.state_uncertainty import Wander, wander

TRUCK = clutchest.load_vehicle("truck")


def equations() -> Model:
    return machine_of(TRUCK.model).equations(set(TRUCK.signals))


def stating(state: str, density: float) -> Vehicle:
    own = next(s for s in equations().states if s.name == state)
    stated = Estimation(own.role, own.process_noise, own.initial_std, own.useful_std, density)
    return replace(TRUCK, estimation={state: stated})


def test_a_walk_covers_what_a_random_walk_does() -> None:
    t = np.sort(np.random.default_rng(0).uniform(10.0, 700.0, 50))
    columns = random_walk(t, 0.5)
    since = t - t[0]
    exact = 0.25 * np.minimum.outer(since, since)
    np.testing.assert_allclose(columns @ columns.T, exact, atol=0.01 * exact.max())


def test_how_far_states_wander_is_the_files_where_it_states_it() -> None:
    assert wander(TRUCK, equations()) == (Wander("friction", 5e-4), Wander("torque_bias", 0.5))
    assert wander(stating("torque_bias", 0.2), equations()) == (Wander("torque_bias", 0.2),)
    assert wander(replace(TRUCK, estimation={}), equations()) == ()


def test_nothing_wanders_unless_asked_for() -> None:
    problem = Problem.of(clutchest.simulate(TRUCK, "launches", 3, duration=300.0), TRUCK, ())
    assert problem.discrepancies == ()
