"""A drive in which the clutch stays closed: next to nothing to tell, and nothing to claim."""

from __future__ import annotations

import pytest

import clutchest
from clutchest.discovery.find import discover

TRUCK = clutchest.load_vehicle("truck")


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3, 4, 5])
def test_nothing_is_found_where_nothing_slips(seed):
    """A curve over the position, which moves by nothing but its noise, was found in every one."""
    effects = {"friction_level": {"change": -0.3}} if seed == 5 else {}
    signals = clutchest.simulate(TRUCK, "closed", seed, effects, duration=600.0)
    answer = discover(signals, TRUCK)
    assert answer.verdict == "none"
    assert "friction_level" in answer.unexcited
