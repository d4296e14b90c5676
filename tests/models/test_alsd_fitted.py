"""The form of the differential's equations that is fitted to whole drives, on the generator's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import uniform_filter1d

import clutchest
from clutchest.inference.covariates import covariates
from clutchest.inference.innovations import NO_DERIVATIVES
from clutchest.inference.problem import Problem
from clutchest.models.alsd import motor_friction
from clutchest.models.alsd.fitted import FITTED, to_fit

RIG = clutchest.load_vehicle("alsd_rig")
DURATION = 12.0


def problem_of(seed: int) -> tuple[Problem, np.ndarray]:
    """A steps run of a rig with the file's own numbers, and θ there."""
    signals = clutchest.simulate(RIG, "rig-steps", seed, duration=DURATION, nominal=True)
    problem = Problem.of(signals, RIG, ())
    return problem, np.zeros(len(problem.thetas))


def errors(problem: Problem, theta: np.ndarray) -> dict[str, np.ndarray]:
    """Normalised innovations by sensor."""
    drive = problem.drives[0]
    r = problem.linearise(theta, {}, NO_DERIVATIVES)[0].r
    names = [sensor.name for sensor in drive.compiled.model.sensors]
    return {name: r[drive.readings.sensor == i] for i, name in enumerate(names)}


@pytest.mark.slow
def test_a_healthy_rig_leaves_noise():
    problem, theta = problem_of(31)
    of = errors(problem, theta)
    for name in ("clutch_torque", "motor_angle"):
        assert np.sqrt(np.mean(of[name] ** 2)) == pytest.approx(1.0, abs=0.1)
        assert abs(np.corrcoef(of[name][1:], of[name][:-1])[0, 1]) < 0.12


@pytest.mark.slow
def test_a_motor_that_cannot_stick_leaves_more(monkeypatch):
    crept = replace(FITTED.swap(motor_friction.lugre, motor_friction.sliding), states=FITTED.states)
    machine = replace(RIG.machine, fitted=lambda names: crept)
    monkeypatch.setattr(type(RIG), "machine", machine)
    problem, theta = problem_of(31)
    assert np.std(errors(problem, theta)["motor_angle"]) > 1.2


@pytest.mark.slow
def test_noise_of_the_voltage_is_not_in_derivatives_and_innovations_alike():
    """Else a current that is held would seem to have an error that goes with the current."""
    problem, theta = problem_of(31)
    drive = problem.drives[0]
    model, readings = drive.compiled.model, drive.readings
    voltage = model.input("armature_voltage")
    course = drive.inputs.interpolated[voltage]
    shakes = np.interp(readings.t, course.time, course.shakes)
    held = (readings.sensor == model.sensor("armature_current")) & (shakes != 0.0)
    r = problem.linearise(theta, {}, NO_DERIVATIVES)[0].r[held]
    assert np.corrcoef(r, shakes[held])[0, 1] < -0.5  # innovations hold it
    left = drive.inputs.smooth[readings.event[held], voltage]
    left = left - uniform_filter1d(left, 51)
    assert abs(np.corrcoef(r, left)[0, 1]) < 0.1  # of parabolas through 0.1 s: −0.2


@pytest.mark.slow
def test_derivatives_are_those_of_the_innovations():
    problem, theta = problem_of(32)
    drive = problem.linearise(theta, {})[0]
    names = [str(unknown) for unknown in problem.thetas]
    for name in ("armature_resistance", "motor_inertia", "ball_ramp_stiffness", "spring_preload"):
        step = np.zeros(len(theta))
        step[names.index(name)] = 0.5
        ahead, back = (
            problem.linearise(theta + sign * step, {}, NO_DERIVATIVES)[0].r for sign in (1, -1)
        )
        own, whole = drive.psi[:, names.index(name)], ahead - back
        assert np.linalg.norm(own - whole) < 0.05 * np.linalg.norm(whole)


@pytest.mark.slow
def test_no_log_at_200_hz_is_asked_for_the_inductance():
    problem, _ = problem_of(33)
    assert "armature_inductance" not in map(str, problem.thetas)
    assert RIG.parameters["armature_inductance"].spread > 0.0


@pytest.mark.slow
def test_covariates_of_what_is_tracked_are_without_the_noise_of_its_readings():
    problem, _ = problem_of(33)
    drive = problem.drives[0]
    still = drive.line.t < 0.5
    values = covariates(drive, drive.at_nominal)["motor_speed"][still]
    tracked = drive.at_nominal.states[still, FITTED.states.index(_state("motor_speed"))]
    assert np.std(values) < 0.3 * np.std(tracked)


def test_a_car_takes_its_slip_from_the_wheels():
    car = to_fit({"wheel_speed_left", "wheel_speed_right", "motor_angle", "shaft_torque"})
    assert {item.name for item in car.inputs} >= {"wheel_speed_left", "wheel_speed_right"}
    assert car.tracked == FITTED.tracked


def _state(name):
    return next(state for state in FITTED.states if state.name == name)


@pytest.mark.slow
def test_a_motor_that_stands_is_not_shaken_until_it_creeps():
    """Shaken by its readings' noise, it would give way to its load: up at home, down while
    pressed."""
    signals = clutchest.simulate(RIG, "rig-slow", 31, duration=40.0, nominal=True)
    problem = Problem.of(signals, RIG, ())
    drive = problem.drives[0]
    model, readings = drive.compiled.model, drive.readings
    r = problem.linearise(np.zeros(len(problem.thetas)), {}, NO_DERIVATIVES)[0].r
    flags = drive.line.W[readings.row]
    stands = flags[:, model.regime.index("moving")] == 0.0
    stands &= readings.sensor == model.sensor("motor_angle")
    pressed = flags[:, model.regime.index("engaged")] > 0.0
    up, down = r[stands & ~pressed], r[stands & pressed]
    error = np.sqrt(np.var(up) / len(up) + np.var(down) / len(down))
    assert min(len(up), len(down)) > 1000
    assert abs(np.mean(up) - np.mean(down)) < 3.0 * error


def test_steps_are_short_while_the_motor_turns_and_as_good_where_it_creeps_or_stands(monkeypatch):
    """Innovations with steps as short throughout differ by a small part of their noise."""
    problem, theta = problem_of(31)
    line = problem.drives[0].line
    moves, fast = (line.W[:, FITTED.regime.index(flag)] > 0 for flag in ("moving", "fast"))
    for where, longest in zip((fast, moves & ~fast, ~moves & ~fast), FITTED.longest, strict=True):
        assert set(line.longest[where]) == {longest}
    short = replace(FITTED, longest=(FITTED.longest[0],) * 3)
    monkeypatch.setattr(type(RIG), "machine", replace(RIG.machine, fitted=lambda names: short))
    finer, _ = problem_of(31)
    found = {}
    for made in (problem, finer):
        readings = made.drives[0].readings
        r = made.linearise(theta, {}, NO_DERIVATIVES)[0].r
        where = zip(readings.sensor.tolist(), readings.t.tolist(), strict=True)
        found[made is finer] = dict(zip(where, r, strict=True))
    both = found[True].keys() & found[False].keys()
    assert len(both) > 0.99 * len(found[True])  # hardly a reading is used by one alone
    off = np.array([found[True][key] - found[False][key] for key in both])
    assert np.sqrt(np.mean(off**2)) < 0.03


def test_contact_begins_at_any_time_within_a_step():
    """Else wind-up would not depend on when the pack is touched, or a hundred times too much."""
    problem = Problem.of(clutchest.simulate(RIG, "rig-slow", 5, duration=1.0), RIG, ())
    wound = FITTED.states.index(_state("wind_up"))
    free_play = [str(theta) for theta in problem.thetas].index("start of free_play")

    def wind_up(off: float) -> np.ndarray:
        theta = np.zeros(len(problem.thetas))
        theta[free_play] = off
        run = problem.linearise(theta, {}, NO_DERIVATIVES)[0]
        return np.asarray(run.implied.states[:, wound])

    play = RIG.parameters["differential_backlash"].value
    pressed = int(np.argmax(wind_up(0.0) > 1.1 * play))
    less = -np.diff([wind_up(off)[pressed] for off in np.linspace(0.0, 0.5, 41)])
    assert less.min() > 0.5 * less.mean() and less.max() < 1.5 * less.mean()
