"""What noise of the inputs does to states without readings of their own, by drawing it again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import chi2

import clutchest
from clutchest.inference.input_noise_covariance import (
    InputNoiseCovariance,
    main_directions,
    taken_in,
)
from clutchest.inference.problem import Problem
from clutchest.models import machine_of
from clutchest.models.regimes import Mode
from clutchest.signals import Signal, Signals
from clutchest.simulated import simulate_sampled

DRAWS, MAIN = 12, 6
TRUCK = clutchest.load_vehicle("truck")


def quiet(seed: int) -> Signals:
    """Launches with sensors a thousand times better than the vehicle file says."""
    fine = {n: replace(s, noise=1e-3 * s.noise, noise_ar=0.0) for n, s in TRUCK.signals.items()}
    vehicle = replace(TRUCK, signals=fine)
    made = simulate_sampled(vehicle, "launches", seed, nominal=True, duration=400.0)
    return Signals({n: Signal.of(n, "", t, v) for n, (t, v) in made.signals.items()}, end=400.0)


def shaken(signals: Signals, slips: NDArray[np.bool_], seed: int) -> Signals:
    """The same with the coolant sensor's noise, and the position's where it ``slips`` (K)."""
    rng, noisy = np.random.default_rng(seed), {}
    # the first coolant temperature is what the drive starts from, which is estimated by itself
    later = signals["coolant_temp"].time > signals["coolant_temp"].time[0] + 1.0
    for name, at in (("slave_position", slips), ("coolant_temp", later)):
        read = signals[name]
        noise = TRUCK.signals[name].noise * rng.normal(size=len(read.value))
        noisy[name] = replace(read, value=read.value + np.where(at, noise, 0.0))
    return Signals({**signals, **noisy}, end=signals.end)


@pytest.fixture(scope="module")
def drive() -> Signals:
    return quiet(3)


@pytest.fixture(scope="module")
def problem(drive: Signals) -> Problem:
    return Problem.of(drive, TRUCK, ())


@pytest.mark.slow
def test_noise_that_heats_the_clutch_scatters_readings_as_foreseen(drive, problem):
    """Noise of the coolant's temperature, and of the position during slips, where it is not read
    itself, moves the zero positions read afterwards along the walk's main directions as far as
    those say."""
    [own] = problem.drives
    sensor = own.compiled.model.sensor("zero_position")
    zero = own.readings.sensor == sensor
    time = drive["slave_position"].time
    before = np.clip(np.searchsorted(own.line.t, time), 0, len(own.line.t) - 1)
    slips = own.line.mode[before] == Mode.slipping
    theta, none = np.zeros(len(problem.thetas)), np.zeros(0, int)
    base = problem.linearise(theta, {}, none)[0].r[zero]
    seen = InputNoiseCovariance.of(own.readings.input_noise[zero])
    main = np.argsort(seen.strong)[-MAIN:]
    squares = []
    for seed in range(DRAWS):
        again = Problem.of(shaken(drive, slips, seed), TRUCK, ())
        [other] = again.drives
        same = other.readings.sensor == sensor
        np.testing.assert_array_equal(other.readings.t[same], own.readings.t[zero])
        moved = again.linearise(theta, {}, none)[0].r[same] - base
        along = seen.along[:, main].T @ moved / seen.strong[main]
        squares.append(along @ along)
        assert moved @ moved > 0.0
    low, high = chi2.ppf([0.005, 0.995], DRAWS * MAIN)
    assert low < sum(squares) < high, (low, sum(squares), high)


def test_inputs_that_the_temperatures_take_in():
    names = taken_in(machine_of(TRUCK.model).equations(set(TRUCK.signals)))
    assert {"slave_position", "coolant_temp"} <= set(names)
    assert "engine_torque" not in names  # it moves the engine only, whose speed is read


def test_a_walk_is_taken_out_of_what_it_moves():
    rng = np.random.default_rng(0)
    columns = rng.normal(size=(200, 3)) * (0.1, 1.0, 5.0)
    walk = InputNoiseCovariance.of(columns)
    root = np.eye(200)
    walk.whiten_in_place(root)
    np.testing.assert_allclose(
        root @ (np.eye(200) + columns @ columns.T) @ root.T, np.eye(200), atol=1e-9
    )


def test_what_is_most_probable_of_a_walk():
    rng = np.random.default_rng(1)
    columns, white = rng.normal(size=(50, 4)), rng.normal(size=50)
    found = InputNoiseCovariance.of(columns).probable(white)
    exact = np.linalg.solve(columns.T @ columns + np.eye(4), columns.T @ white)
    np.testing.assert_allclose(found, exact, atol=1e-12)


def test_no_walk_changes_nothing():
    table = np.ones((5, 2))
    InputNoiseCovariance.of(np.zeros((5, 0))).whiten_in_place(table)
    np.testing.assert_array_equal(table, np.ones((5, 2)))


@pytest.mark.parametrize("size", [1e200, np.inf])
def test_responses_that_run_away_have_no_direction(size):
    assert main_directions(np.full((5, 3), size)).shape == (5, 0)
