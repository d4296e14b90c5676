"""Warnings beside the answer."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from clutchest.discovery.sentences import doubtful, implausible_residuals
from clutchest.machine import Sensor


@pytest.mark.parametrize(("p", "said"), [(5e-5, True), (2e-4, False)])
def test_an_error_that_a_second_drive_would_decide_is_said(p: float, said: bool) -> None:
    errors = [SimpleNamespace(equation=name, p_value=p) for name in ("torque", "body_heat")]
    warnings = doubtful(errors)
    assert len(warnings) == said
    assert all("'torque' has p = 5e-05" in warning for warning in warnings)
    assert doubtful([]) == ()


def test_residuals_that_no_error_of_the_equations_makes_are_named() -> None:
    """Beyond the last of the multiples of a sensor's tolerance by which `replay` judges."""
    sensors = [Sensor("speed", "rad/s", "ω", "shaft"), Sensor("oil", "°C", "T", "oil", tolerance=4)]
    assert implausible_residuals({"speed": 249.0, "oil": 99.0}, sensors) == []
    assert implausible_residuals({}, sensors) == []
    (words,) = implausible_residuals({"speed": 5853.6, "oil": 101.0}, sensors)
    assert words.startswith("the residuals of speed are 5854 times and oil are 101 times the noise")
