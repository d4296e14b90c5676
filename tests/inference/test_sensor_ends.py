"""Readings near the end of a sensor's range, of which noise leaves only some."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import clutchest
from clutchest.inference.innovations import NO_DERIVATIVES
from clutchest.inference.map_fit import settle
from clutchest.inference.objective import Objective
from clutchest.inference.problem import Problem
from clutchest.inference.sensor_ends import settled_off_ends
from clutchest.signals import Signal, Signals
from clutchest.vehicle import Vehicle
from foreign_machines import vehicle

NOISE, PERIOD, COUNT, STEPS = 0.3, 4.0, 500, 40
END = 9.99  # V


def level(pump: np.ndarray) -> np.ndarray:
    """The lower tank's (V) of a rig as tanks.py has it, under these voltages."""
    upper, lower, read = 5.0, 5.0, []
    for u in pump:
        read.append(lower)
        for _ in range(STEPS):
            out, dt = 0.05 * np.sqrt(max(upper, 0.0)), PERIOD / STEPS
            upper += dt * (0.045 * u - out)
            lower += dt * (out - 0.05 * np.sqrt(max(lower, 0.0)))
    return np.array(read)


def record(seed: int, end: float = END) -> Signals:
    """Voltages that bring the level to the sensor's end now and then; readings beyond are none."""
    rng, time = np.random.default_rng(seed), PERIOD * np.arange(COUNT)
    wave = sum(np.sin(2e-3 * np.pi * f * time + rng.uniform(0, 7)) for f in (0.7, 1.6, 2.9))
    pump = 3.2 + 0.5 * wave
    read = level(pump) + NOISE * rng.standard_normal(COUNT)
    held = np.column_stack([time, time + 3.9]).ravel()
    return Signals(
        {
            "pump": Signal.of("pump", "V", held, np.repeat(pump, 2)),
            "level": Signal.of("level", "V", time, np.where(read < end, read, np.nan)),
        }
    )


def noisy(end: float | None = END, unit: str = "V") -> Vehicle:
    """The tanks, read with so much noise, and up to an ``end`` in a ``unit`` of the bus."""
    tanks = vehicle("tanks")
    read = tanks.signals["level"]
    read = replace(read, noise=NOISE, maximum=end, bus=replace(read.bus, unit=unit))
    return replace(tanks, signals={**tanks.signals, "level": read})


def errors_near(problem: Problem, theta: np.ndarray, last: float) -> np.ndarray:
    """Errors of what counts, in deviations, where the prediction is one at most below ``last``."""
    [drive], [raw] = problem.drives, problem.linearise(theta, {}, NO_DERIVATIVES)
    predicted = drive.line.z[drive.readings.event] - raw.r * drive.readings.std
    return raw.r[(predicted < last) & (predicted > last - NOISE)]


@pytest.mark.slow
def test_errors_near_the_end_have_no_mean():
    every, own = [], []
    for seed in range(12):
        problem = Problem.of(record(seed), noisy(), ())
        _, fit = settle(Objective.of(problem), problem.begin)
        every.append(errors_near(problem, fit.theta, END))
        objective, fit = settled_off_ends(problem)
        own.append(errors_near(objective.problem, fit.theta, END - 2.0 * NOISE))
    every, own = np.concatenate(every), np.concatenate(own)
    assert len(own) > 100
    assert every.mean() < -5.0 / np.sqrt(len(every))  # those that are left are low
    assert abs(own.mean()) < 3.0 / np.sqrt(len(own))


def test_what_counts_is_known_from_the_prediction():
    problem = Problem.of(record(1), noisy(), ())
    objective, fit = settled_off_ends(problem)
    [drive], [raw] = objective.problem.drives, fit.raw
    assert 0.5 * COUNT < len(raw.r) < len(problem.drives[0].readings.t)
    z = drive.line.z[drive.readings.event]
    assert (z - raw.r * drive.readings.std).max() < END - 1.8 * NOISE
    assert z.max() > END - NOISE  # not the reading


def test_an_end_stands_in_the_unit_of_the_bus():
    kept = [
        len(
            settled_off_ends(Problem.of(record(1), noisy(*end), ()))[0].problem.drives[0].readings.t
        )
        for end in ((END, "V"), (1000.0 * END, "0.001 V"))
    ]
    assert kept[0] == kept[1] < COUNT


@pytest.mark.parametrize("end", [None, 30.0])
def test_without_an_end_in_reach_every_reading_counts(end):
    problem = Problem.of(record(1, np.inf), noisy(end), ())
    objective, _ = settled_off_ends(problem)
    assert len(objective.problem.drives[0].readings.t) == len(problem.drives[0].readings.t)


def test_where_the_equations_have_everything_beyond_the_end_all_readings_count():
    problem = Problem.of(record(1, np.inf), noisy(0.5), ())
    objective, _ = settled_off_ends(problem)
    assert len(objective.problem.drives[0].readings.t) == COUNT


def with_engine_speed(after: Callable[[np.ndarray], np.ndarray]) -> Signals:
    """A drive whose engine has other speeds ``after`` 45 s, by their times (s)."""
    signals = clutchest.simulate(clutchest.load_vehicle("truck"), "launches", 5, duration=60.0)
    speed = signals["engine_speed"]
    value = np.where(speed.time > 45.0, after(speed.time), speed.value)
    own = replace(speed, value=value)
    return replace(signals, signals={**signals.signals, "engine_speed": own})


def read_below(problem: Problem, speed: float) -> int:
    """How many readings of the one drive are lower, rad/s: positions, mm, are not."""
    [drive] = problem.drives
    return int(np.count_nonzero(drive.line.z[drive.readings.event] < speed))


def test_of_an_engine_that_has_stalled_no_speed_counts():
    noise = np.random.default_rng(2)
    signals = with_engine_speed(lambda t: np.maximum(noise.normal(0.0, 0.06, len(t)), 0.0))
    truck = clutchest.load_vehicle("truck")
    endless = replace(truck.signals["engine_speed"], minimum=None)
    for each in (truck, replace(truck, signals={**truck.signals, "engine_speed": endless})):
        problem = Problem.of(signals, each, ())
        assert read_below(problem, 1.0) > 100
        assert read_below(settled_off_ends(problem)[0].problem, 1.0) == 0


def test_of_an_engine_that_is_dragged_without_running_no_speed_counts():
    signals = with_engine_speed(lambda t: 15.0 + 10.0 * np.sin(t))
    problem = Problem.of(signals, clutchest.load_vehicle("truck"), ())
    assert read_below(problem, 26.0) > 100
    assert read_below(settled_off_ends(problem)[0].problem, 30.0) == 0
