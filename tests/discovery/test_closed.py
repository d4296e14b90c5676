"""A drive in which the clutch stays closed: next to nothing to tell, and nothing to claim."""

from __future__ import annotations

import pytest

import clutchest
from clutchest.discovery.discover import discover
from clutchest.inference.covariates import at_rest, covariates
from clutchest.inference.problem import Problem

TRUCK = clutchest.load_vehicle("truck")


@pytest.mark.slow
def test_an_input_at_rest_is_told_and_still_has_values():
    """Curves found in another drive ask for them."""
    rest, moves = (
        Problem.of(clutchest.simulate(TRUCK, scenario, 1, duration=200.0), TRUCK, ()).drives[0]
        for scenario in ("closed", "launches")
    )
    moving = {"slave_position", "position_rate", "recent_movement"}
    assert moving <= at_rest(rest, rest.at_nominal)
    assert not {"slave_position", "position_rate", "engine_torque"} & at_rest(
        moves, moves.at_nominal
    )
    assert {"slave_position", "position_rate"} <= set(covariates(rest, rest.at_nominal))


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3, 4, 5])
def test_nothing_is_found_where_nothing_slips(seed):
    """A curve over the position, which moves by nothing but its noise, was found in every one."""
    effects = {"friction_level": {"change": -0.3}} if seed == 5 else {}
    signals = clutchest.simulate(TRUCK, "closed", seed, effects, duration=600.0)
    answer = discover(signals, TRUCK)
    assert answer.verdict == "none"
    assert "friction_level" in answer.unexcited
