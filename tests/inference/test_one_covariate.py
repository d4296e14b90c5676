"""One covariate of a drive, and all of them."""

from __future__ import annotations

import numpy as np
import pytest

import clutchest
from clutchest.inference.covariates import covariate, covariates
from clutchest.inference.problem import Problem


@pytest.mark.parametrize(
    ("vehicle", "scenario"), [("truck", "launches"), ("alsd_rig", "rig-steps")]
)
def test_one_is_what_it_is_among_all(vehicle: str, scenario: str) -> None:
    car = clutchest.load_vehicle(vehicle)
    signals = clutchest.simulate(car, scenario, 3, duration=20.0)
    (drive,) = Problem.of(signals, car, (), discrepant=True).drives
    also = car.machine.smooth_over
    known = covariates(drive, drive.at_nominal, also)
    assert {error.covariate for error in car.smooth_errors} <= set(known)
    for name, value in known.items():
        one = covariate(drive, drive.at_nominal, name, also)
        assert one is not None
        np.testing.assert_array_equal(one, value, err_msg=name)
    assert covariate(drive, drive.at_nominal, "no such quantity", also) is None
