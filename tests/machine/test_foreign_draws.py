"""Records of others' machines that are drawn to count false alarms."""

from __future__ import annotations

import runpy
import sys
from dataclasses import replace
from types import ModuleType

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter

from clutchest.identify.fitted_machine import FittedMachine
from clutchest.machine import Observed
from clutchest.models.thresholds import Thresholds
from clutchest.reading import read_log
from foreign_machines import MACHINES, module, vehicle


def test_noise_of_a_draw_is_coloured_like_the_residuals():
    """Slow residuals are drawn without jumps, with their size and memory, not with their mean."""
    foreign = runpy.run_path(str(MACHINES.parent / "benchmarks" / "foreign.py"))
    rng = np.random.default_rng(3)
    error = 1.0 + lfilter([0.1], [1.0, -0.95], rng.standard_normal(4000))
    taps, rest = foreign["innovations"](error, np.ones(len(error), bool))
    made = foreign["drawn"](rng, taps, rest, len(error))
    assert np.std(rest) == pytest.approx(0.1, rel=0.05)
    assert np.std(made) == pytest.approx(np.std(error), rel=0.2)
    assert abs(np.mean(made)) < 0.2
    assert np.abs(np.diff(made)).max() < 1.5 * np.abs(np.diff(error)).max()


def test_the_level_beyond_the_sensors_end_is_known_from_the_simulation():
    foreign = runpy.run_path(str(MACHINES.parent / "benchmarks" / "foreign.py"))
    above = module("tanks", "tanks").above
    level = np.array([2.0, 9.9, 10.5, 12.0])
    reading = level - np.array([float(above(x, 10.0)) for x in level])
    assert foreign["unlimited"](reading) == pytest.approx(level, abs=1e-3)


def test_the_servos_equations_do_not_hold_where_it_turns():
    """Nor where it is slow, nor for as long around as the means of a reading reach."""
    time, signals = 0.025 * np.arange(60), {}
    signals["speed"] = np.where(time < 0.5, 2.0, -2.0)
    signals["speed"][50] = -0.1
    nothing = np.zeros(len(time), bool)
    observed = Observed(time, signals.get, nothing, nothing, {}, Thresholds())
    free = module("servo", "sts3215").turning(observed).free_running
    assert np.flatnonzero(~free).tolist() == [*range(17, 23), *range(48, 53)]
    signals["speed"] = np.full(len(time), 2.0)
    assert module("servo", "sts3215").turning(observed).free_running.all()


@pytest.fixture
def servo(monkeypatch) -> ModuleType:
    """The servo's closed loop; files of other folders have the same names."""
    for name in ("convert", "run"):
        monkeypatch.setitem(sys.modules, name, module("servo", name))
    return module("servo", "closed_loop")


@pytest.mark.slow
def test_draws_of_the_servo_are_of_the_numbers_that_made_them(servo, tmp_path):
    """Around a model fitted to swings that the published one has made; a seed is a record."""
    car, run = vehicle("servo"), sys.modules["run"]
    time = run.STEP * np.arange(1000)
    columns = {"time_s": time, "arm_m": 0.1, "kp": 16.0, "supply_V": 12.0, "torque_enabled": 1.0}
    runs = []
    for mass, pace in ((0.5, 2.0), (1.0, 3.0), (1.0, 5.0)):
        goal = 1.2 * np.sin(pace * time) + 0.3 * np.sin(3.1 * pace * time)
        own = columns | {"mass_kg": mass, "goal_rad": goal, "position_rad": 0.0, "torque": 0.0}
        runs.append(pd.DataFrame(own))
    bench = run.Bench(runs)
    path = run.by_published(bench)
    for i, each in enumerate(runs):
        duty = bench.duty(bench.goal, path)[:, i]
        each["position_rad"] = path[:, i]
        each["torque"] = np.where(duty > 0.0, 10.24 + 10.0 * duty, -10.0 * duty)

    def read(tables):
        paths = [tmp_path / f"{i}.parquet" for i in range(len(tables))]
        for path, table in zip(paths, tables, strict=True):
            table.to_parquet(path, index=False)
        return read_log(paths, car)

    signals = read([sys.modules["convert"].table(each) for each in runs])
    fitted = FittedMachine.of(signals, car)
    loop = servo.Loop.of(runs, fitted)
    assert (loop.late, loop.rate) == (0, np.inf)
    calm = read(replace(loop, spectrum=0.0 * loop.spectrum).drawn(1))
    own = FittedMachine.of(calm, car)
    error = np.concatenate([each.error for each in own.predicted(calm, "speed")])
    assert np.sqrt(np.mean(error**2)) < 0.005  # rad/s: what is drawn is what is reported
    assert own.numbers["armature"] == pytest.approx(fitted.numbers["armature"], rel=0.02)
    first, again, other = (loop.drawn(seed) for seed in (1, 1, 2))
    pd.testing.assert_frame_equal(first[0], again[0])
    assert np.std(first[0]["speed"] - other[0]["speed"]) > 1e-4
    drawn = FittedMachine.of(read(first), car)
    for name in ("resistance", "torque_constant", "viscous"):
        assert drawn.numbers[name] == pytest.approx(fitted.numbers[name], rel=0.1)
    made = read(loop.as_noisy(signals, read).drawn(3))
    own = servo.coloured_noise.autocovariance(FittedMachine.of(made, car), made, servo.READING)
    wanted = servo.coloured_noise.autocovariance(fitted, signals, servo.READING)
    assert np.sqrt(own[0]) == pytest.approx(np.sqrt(wanted[0]), rel=0.4)
    assert own[1] / own[0] == pytest.approx(wanted[1] / wanted[0], abs=0.25)
