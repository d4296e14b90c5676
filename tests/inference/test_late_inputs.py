"""How an input that may be late moves: by its slope, derivatives by its delay are taken."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import clutchest
from clutchest.inference.problem import Problem

TRUCK = clutchest.load_vehicle("truck")


@pytest.mark.parametrize(("ar", "least"), [(0.0, 0.99), (0.9, 0.88)])
def test_a_position_sets_off_when_it_does(ar: float, least: float) -> None:
    """Autocorrelated noise lets what is sudden tell most; so is it weighed here."""
    of = TRUCK.signals["slave_position"]
    vehicles = [
        replace(TRUCK, signals={**TRUCK.signals, of.name: replace(of, noise=std, noise_ar=ar)})
        for std in (of.noise, 1e-9)
    ]
    read, exact = (clutchest.simulate(v, "launches", 5, duration=60.0) for v in vehicles)
    (drive,) = Problem.of(read, vehicles[0], TRUCK.machine.effects.values()).drives
    time, value = drive.inputs.denoised[drive.compiled.model.input(of.name)]
    moves = [np.diff(each) for each in (value, exact[of.name].at(time))]
    acts = np.interp(time[2:], drive.line.t, drive.tracked.act) > 0.5
    told, true = (each[1:] - ar * each[:-1] for each in moves)
    assert np.corrcoef(told[acts], true[acts])[0, 1] > least
