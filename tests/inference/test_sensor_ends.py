"""Readings near the end of a sensor's range, of which noise leaves only some."""

from __future__ import annotations

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


def test_of_an_engine_that_has_stalled_no_speed_counts():
    truck = clutchest.load_vehicle("truck")
    signals = clutchest.simulate(truck, "launches", 5, duration=60.0)
    speed = signals["engine_speed"]
    noise = np.random.default_rng(2).normal(0.0, 0.06, len(speed.time))
    stalled = np.where(speed.time > 45.0, np.maximum(noise, 0.0), speed.value)
    signals = replace(
        signals, signals={**signals.signals, "engine_speed": replace(speed, value=stalled)}
    )

    def near_none(vehicle: Vehicle) -> int:
        [drive] = settled_off_ends(Problem.of(signals, vehicle, ()))[0].problem.drives
        return int(np.count_nonzero(drive.line.z[drive.readings.event] < 1.0))

    endless = replace(truck.signals["engine_speed"], minimum=None)
    assert near_none(replace(truck, signals={**truck.signals, "engine_speed": endless})) == 0
    assert near_none(truck) == 0


def test_of_an_engine_that_is_dragged_without_running_no_speed_counts():
    truck = clutchest.load_vehicle("truck")
    signals = clutchest.simulate(truck, "launches", 5, duration=60.0)
    speed = signals["engine_speed"]
    dragged = np.where(speed.time > 45.0, 15.0 + 10.0 * np.sin(speed.time), speed.value)
    signals = replace(
        signals, signals={**signals.signals, "engine_speed": replace(speed, value=dragged)}
    )
    problem = Problem.of(signals, truck, ())
    [all_of_it], [drive] = problem.drives, settled_off_ends(problem)[0].problem.drives
    assert np.count_nonzero(all_of_it.line.z[all_of_it.readings.event] < 26.0) > 100
    assert drive.line.z[drive.readings.event].min() > 30.0
