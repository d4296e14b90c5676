"""Readings beside sharp bends of the inputs: which count, and what they tell."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import clutchest
from clutchest.discovery.residual_curves import places
from clutchest.inference.input_bends import AGAINST, SETTLED, SHARP
from clutchest.inference.linearisation import Modulation
from clutchest.inference.noise_model import SENSOR
from clutchest.inference.objective import Objective
from clutchest.inference.problem import Problem
from clutchest.models import machine_of
from clutchest.models.error_term_effects import error_term_effects
from clutchest.signals import Floats, Signals
from clutchest.vehicle import Vehicle

TRUCK = clutchest.load_vehicle("truck")
NOISE = TRUCK.signals["slave_position"].noise


@pytest.fixture(scope="module")
def signals() -> Signals:
    """The pedal is let go at once, again and again."""
    return clutchest.simulate(TRUCK, "pulses", 4, duration=120.0)


def problem_of(signals: Signals, vehicle: Vehicle = TRUCK) -> Problem:
    return Problem.of(signals, vehicle, tuple(error_term_effects(machine_of(vehicle.model))))


def with_position(signals: Signals, value: Floats) -> Signals:
    position = replace(signals["slave_position"], value=value)
    return replace(signals, signals={**signals.signals, "slave_position": position})


def test_readings_after_a_bend_have_noise_of_their_own(signals):
    readings = problem_of(signals).drives[0].readings
    assert 20 < np.count_nonzero(readings.bent) < 0.2 * len(readings.t)
    position = signals["slave_position"]
    sharp = np.abs(np.diff(position.value, 2)) > SHARP * NOISE
    since = readings.t[readings.bent > 0, None] - position.time[1:-1][sharp]
    assert np.all(np.any((since > -0.02) & (since < SETTLED + 0.02), axis=1))
    groups = readings.stretches.group
    turns, after, calm = (set(groups[readings.bent == how]) for how in (2, 1, 0))
    assert turns and not turns & after | turns & calm | after & calm
    assert set(groups // SENSOR) == set(readings.sensor)


def test_readings_after_a_single_reading_far_off_are_left_out(signals):
    """Of a pedal at rest in the middle of a slip: nothing else bends there."""
    clean = problem_of(signals).drives[0].readings
    position = signals["slave_position"]
    calm = clean.t[(clean.bent == 0) & (clean.sensor == clean.sensor[0])]
    apart = np.flatnonzero(np.convolve(np.diff(calm) < 0.02, np.ones(20), "valid") == 20)
    at = int(np.searchsorted(position.time, calm[apart[len(apart) // 2] + 10]))
    value = position.value.copy()
    value[at] += 2.0 * SHARP * NOISE
    readings = problem_of(with_position(signals, value)).drives[0].readings
    lost = np.setdiff1d(clean.t, readings.t) - position.time[at]
    assert len(lost) > 3
    assert np.all((lost > -0.03) & (lost < SETTLED + 0.03))
    assert 2.0 * AGAINST < 1.0  # the neighbours' second differences are half of its own


def test_what_is_switched_is_not_followed_through_its_steps():
    """The voltage of a motor: no reading beside its steps counts."""
    rig = clutchest.load_vehicle("alsd_rig")
    signals = clutchest.simulate(rig, "rig-steps", 3, duration=10.0)
    assert not problem_of(signals, rig).drives[0].readings.bent.any()


def test_bends_tell_most_of_delays(signals):
    """A position that is late by more and more: without the readings beside bends, half of what the
    drive tells of it and more would be lost."""
    problem = problem_of(signals)
    objective = Objective.of(problem)
    fit = objective.white_at(np.zeros(len(problem.thetas)))
    which = np.array([places(problem)["timing:slave_position"]])
    later = (Modulation(drive.line.t[:, None], np.array([0])) for drive in problem.drives)
    by = objective.modulated(fit, which, later)[:, 0]
    bent = problem.drives[0].readings.bent > 0
    assert by[bent] @ by[bent] > by[~bent] @ by[~bent]
