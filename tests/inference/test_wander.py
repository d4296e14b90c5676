"""How far states wander: what is stated, what a log shows, and the sines that make a walk."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

import clutchest
from clutchest.inference.problem import Problem
from clutchest.inference.wander import (
    SHARES,
    WanderingDrive,
    probability,
    probable_shares,
    random_walk,
)
from clutchest.models import machine_of
from clutchest.models.model import Model
from clutchest.vehicle import Estimation, Vehicle
from clutchest.vehicle.state_uncertainty import wander

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
    assert wander(TRUCK, equations()) == {"friction": 5e-4, "torque_bias": 0.5}
    assert wander(stating("torque_bias", 0.2), equations())["torque_bias"] == 0.2
    assert wander(replace(TRUCK, estimation={}), equations()) == {}


def test_nothing_wanders_unless_asked_for() -> None:
    problem = Problem.of(clutchest.simulate(TRUCK, "launches", 3, duration=300.0), TRUCK, ())
    assert problem.wanders == {}


@pytest.mark.parametrize("share", [0.0, 0.25, 1.0])
def test_the_share_that_a_walk_shows(share: float) -> None:
    """In the mean over logs, of variances; as wide as such an estimate scatters."""
    rng, found = np.random.default_rng(7), []
    for _ in range(20):
        known, columns = rng.normal(size=(400, 3)), 3.0 * rng.normal(size=(400, 40)) / 20.0
        r = rng.normal(size=400) + known @ rng.normal(size=3)
        r += share * columns @ rng.normal(size=40)
        drive = WanderingDrive.of(np.column_stack([r, known]), [columns])
        found.append(probable_shares([drive])[0])
    assert SHARES.min() <= min(found) and max(found) <= SHARES.max()
    assert np.sqrt(np.mean(np.square(found))) == pytest.approx(share, abs=0.2)


def test_how_probable_a_share_is_of_data_with_fewer_unknowns() -> None:
    """As by the densities of the normal distribution that is stated."""
    rng = np.random.default_rng(9)
    columns, known = rng.normal(size=(60, 8)), rng.normal(size=(60, 3))
    r = rng.normal(size=60) + 0.7 * columns @ rng.normal(size=8)
    drive = WanderingDrive.of(np.column_stack([r, known]), [columns])
    told, exact = [], []
    for share in (0.0, 0.3, 1.0):
        told.append(probability([drive.beside(np.array([0, 2]))], np.array([share])))
        covariance = np.eye(60) + share**2 * columns @ columns.T
        covariance += known[:, [0, 2]] @ known[:, [0, 2]].T
        exact.append(multivariate_normal(np.zeros(60), covariance).logpdf(r))
    np.testing.assert_allclose(np.diff(told), np.diff(exact), rtol=1e-6)


def test_two_drives_are_judged_as_one_table_of_both() -> None:
    """Drives share no walk: their directions are those of one drive with columns for each."""
    rng = np.random.default_rng(8)
    tables = [rng.normal(size=(90, 4)) for _ in range(2)]
    columns = [rng.normal(size=(90, 6)) for _ in range(2)]
    apart = probable_shares(
        [WanderingDrive.of(t, [c]) for t, c in zip(tables, columns, strict=True)]
    )
    none = np.zeros((90, 6))
    both = np.vstack([np.column_stack([columns[0], none]), np.column_stack([none, columns[1]])])
    together = probable_shares([WanderingDrive.of(np.vstack(tables), [both])])
    np.testing.assert_allclose(apart, together, rtol=1e-9)
