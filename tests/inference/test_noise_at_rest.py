"""What of the noise of inputs is left in a drive."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from clutchest import load_vehicle
from clutchest.inference.objective import Objective
from clutchest.inference.problem import Problem
from clutchest.simulated import simulate


def test_a_motor_let_go_keeps_to_its_course_while_the_voltage_turns():
    """Without noise its angle comes out to a fraction of the noise that the file states: it was off
    by 0.9 of it with a mean of the voltage over 0.1 s."""
    rig = load_vehicle("alsd_rig")
    exact = {name: replace(s, noise=1e-3 * s.noise) for name, s in rig.signals.items()}
    run = simulate(replace(rig, signals=exact), "rig-slow", 1, duration=9.0, nominal=True)
    problem = Problem.of(run, rig, (), discrepant=True)
    (raw,) = Objective.of(problem).linearise_at(np.zeros(len(problem.thetas)), {}).raw
    readings = problem.drives[0].readings
    released = (readings.t > 7.9) & (readings.t < 8.06)
    angle = readings.sensor == problem.compiled.model.sensor("motor_angle")
    assert np.abs(raw.r[angle & released]).max() < 0.3


def test_an_oil_temperature_that_does_not_move_is_known_to_a_fraction_of_its_noise():
    """At 10 Hz parabolas through 0.1 s hold one sample."""
    rig = load_vehicle("alsd_rig")
    run = simulate(rig, "rig-steps", 1, duration=20.0)
    (drive,) = Problem.of(run, rig, (), discrepant=True).drives
    oil = drive.inputs.smooth[:, drive.compiled.model.input("oil_temp")]
    assert np.std(run["oil_temp"].value) > 0.25
    assert np.std(oil) < 0.1
