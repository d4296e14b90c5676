"""Sizes do not hold what noise of the readings does to derivatives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import clutchest
from clutchest.inference.noise_bias import noisier


@pytest.mark.slow
@pytest.mark.parametrize("change", [0.0869, -0.0869])
def test_the_gain_of_a_current_sensor_is_not_biased(change):
    """Of a specimen with the file's own numbers nothing but noise makes a size wrong, a tenth of
    its standard deviation; it was 0.8 of it."""
    hidden = {"current_gain": {"change": change}}
    run = clutchest.simulate("alsd_rig", "rig-ramps", 701, hidden, duration=60.0, nominal=True)
    found = clutchest.discover(run, "alsd_rig")
    assert found.sets == (("current_gain",),)
    size = found.causes[0].parameters["change"]
    assert size.value == pytest.approx(change, abs=0.35 * size.std)


def test_noise_once_more_is_that_which_the_file_states():
    rig = clutchest.load_vehicle("alsd_rig")
    coloured = replace(rig.signals["armature_voltage"], noise_ar=0.9)
    rig = replace(rig, signals={**rig.signals, "armature_voltage": coloured})
    run = clutchest.simulate(rig, "rig-steps", 1, duration=20.0)
    more = noisier(run, rig, np.random.default_rng(1))
    for name in ("armature_voltage", "armature_current"):
        off = more[name].value - run[name].value
        stated = rig.signals[name]
        assert np.std(off) == pytest.approx(stated.noise, rel=0.15)
        assert np.corrcoef(off[1:], off[:-1])[0, 1] == pytest.approx(stated.noise_ar, abs=0.05)
