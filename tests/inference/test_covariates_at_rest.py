"""Covariates of errors that show in what is read at rest as well."""

from __future__ import annotations

import numpy as np
import pytest

import clutchest
from clutchest.discovery.residual_curves import CurvesAt
from clutchest.discovery.search import begin
from clutchest.inference.covariates import knots, measured_at_rest
from clutchest.inference.problem import Problem
from clutchest.models import machine_of
from clutchest.models.error_term_effects import error_term_effects


def test_knots_reach_as_far_as_a_reading_is_taken_elsewhere():
    value = np.concatenate([np.linspace(36.0, 44.0, 800), np.full(200, 38.0), np.full(100, 20.0)])
    acts = np.concatenate([np.ones(800), np.zeros(300)])
    machine = machine_of("dry_clutch")
    (own,) = knots(machine, "slave_position", value, acts)
    (near,) = knots(machine, "slave_position", value, acts, value == 38.0)
    (far,) = knots(machine, "slave_position", value, acts, value == 20.0)
    assert len(own) == 5 and np.array_equal(near, own)
    assert np.array_equal(far[1:], own) and far[0] == pytest.approx(20.0)


def test_what_equations_do_not_imply_is_as_measured():
    """Where the clutch is closed, no equation says what the engine's torque is."""
    truck = clutchest.load_vehicle("truck")
    log = clutchest.simulate(truck, "launches", 3, duration=60.0)
    search = begin(Problem.of(log, truck, error_term_effects(truck.machine)))
    fit = search.objective.white_at(search.null.fit.theta)
    (drive,), (at,) = search.problem.drives, fit.implied
    measured, acts = measured_at_rest(drive, at), drive.tracked.act
    j = drive.compiled.model.input("engine_torque")
    assert np.array_equal(measured.inputs[acts], at.inputs[acts])
    raw = at.inputs[:, j] - at.corrections.get(j, np.zeros(len(acts)))
    assert np.allclose(measured.inputs[~acts, j], raw[~acts])
    assert CurvesAt.of(search.objective, fit).bends("engine_torque", "sensor:slave_position")
