"""A healthy truck whose disc passes a threshold that the vehicle file's does not."""

from __future__ import annotations

import pytest

from clutchest.discovery import discover as discovering
from clutchest.simulated import simulate


@pytest.mark.slow
def test_a_disc_that_expands_no_further_is_not_taken_for_fade():
    """Its disc is lighter and gives off less heat, by 1.6 spreads each: in the hottest of its
    launches it gets 114 K over the body, and from 110 K on it expands no further."""
    drive = simulate("truck", "launches", 2456, duration=1003.0, noise_ar=0.0)
    assert discovering.discover(drive, "truck").verdict == "none"
