"""Moves of a leader that its follower has to follow."""

from __future__ import annotations

import numpy as np
import pytest

import clutchest
from clutchest.diagnosis.faults.moves import Following, Move
from clutchest.signals import Floats, Signal

TIME = np.arange(0.0, 4.0, 0.01)
FAR = [30, 90, 91, 300, 340]  # samples at which the leader is read far off; two in a row stay there


def moves(leader: Floats, follower: Floats, pieces: int = 1) -> list[Move]:
    """Those of the truck's actuator, of samples that come in so many pieces."""
    truck = clutchest.load_vehicle("truck")
    (pair,) = truck.machine.followers
    following = Following(truck, pair)
    found = []
    for rows in np.array_split(np.arange(len(TIME)), pieces):
        both = (Signal.of("", "mm", TIME[rows], value[rows]) for value in (follower, leader))
        found += following.take(*both)
    return found


@pytest.fixture
def ramp() -> Floats:
    """From 5 to 10 mm within a second."""
    return 5.0 + 5.0 * np.clip(TIME - 1.0, 0.0, 1.0)


def test_what_follows_has_moved_as_far(ramp):
    found = moves(ramp, 40.0 + ramp)
    assert len(found) >= 8
    assert [m.moved for m in found] == pytest.approx([m.asked for m in found])
    assert found == moves(ramp, 40.0 + ramp, pieces=37)


def test_what_sticks_has_not(ramp):
    found = moves(ramp, np.full(len(TIME), 45.0))
    assert len(found) >= 8
    assert {m.moved for m in found} == {0.0}


def test_one_reading_far_off_is_no_move(ramp):
    """Two in a row are."""
    off = ramp.copy()
    off[FAR] += 1.0
    found = [m for m in moves(off, 40.0 + ramp) if abs(m.moved - m.asked) > 0.5]
    assert [round(m.end, 2) for m in found] == [0.9, 0.92]
