"""Where a motor stands its voltage is a mean, and where it turns, what is read."""

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
