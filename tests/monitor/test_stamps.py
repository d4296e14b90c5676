"""Stamps of an interface's clock: set, restarted, late, coarse."""

import numpy as np
import pytest

from clutchest.can.bus import Received
from clutchest.can.frames import Frames
from clutchest.monitor.stamps import Stamps

S = 10**9
START = 1_700_000_000 * S


def batch(stamps, at, more=False):
    frames = Frames.empty(len(stamps))
    frames.t_ns[:] = stamps
    return Received(frames, at, more=more)


class Clock:
    """A bus at 100 frames/s, ten in a batch; ``shift`` ns is added to the interface's stamps."""

    def __init__(self, first=START):
        self.at, self.first, self.shift = 0, first, 0
        self.stamps = Stamps(lambda: self.at, lambda: START)
        self.used = []

    def run(self, seconds, late=0, more=False):
        for _ in range(round(10 * seconds)):
            self.at += S // 10
            raw = self.first + self.at + self.shift - np.arange(10)[::-1] * S // 100
            self.used.append(self.stamps.used(batch(raw, self.at + late, more)).t_ns)
        return np.concatenate(self.used)


def test_a_quiet_clock_stays_as_it_is():
    clock = Clock()
    used = clock.run(20.0)
    assert np.array_equal(np.diff(used), np.full(len(used) - 1, S // 100))
    assert used[-1] == START + clock.at and not clock.stamps.jumps


@pytest.mark.parametrize("jump", [-3600.0, -2.0, 2.0, 1e6])
def test_a_clock_that_is_set_does_not_jump(jump):
    clock = Clock()
    clock.run(5.0)
    clock.shift = round(jump * S)
    used = clock.run(10.0)
    steps = np.diff(used)
    assert steps.min() > 0 and steps.max() < S // 5
    assert clock.stamps.jumps == [pytest.approx(jump, abs=0.2)]
    assert used[-1] == pytest.approx(START + clock.at, abs=S // 5)


def test_frames_that_are_late_are_no_jump():
    clock = Clock()
    clock.run(5.0)
    clock.run(3.0, late=2 * S)
    used = clock.run(5.0)
    assert not clock.stamps.jumps
    assert np.array_equal(np.diff(used), np.full(len(used) - 1, S // 100))


@pytest.mark.parametrize("more", [True, False])
def test_frames_that_waited_in_the_socket_are_no_jump_however_long_they_take(more):
    clock = Clock()
    clock.run(5.0)
    clock.run(20.0, late=60 * S, more=more)
    used = clock.run(5.0)
    assert bool(clock.stamps.jumps) == (not more)
    if more:
        assert np.array_equal(np.diff(used), np.full(len(used) - 1, S // 100))


def test_a_clock_of_a_device_becomes_absolute():
    clock = Clock(first=0)
    used = clock.run(2.0)
    assert abs(used[0] - START) < S
    assert np.array_equal(np.diff(used), np.full(len(used) - 1, S // 100))


def test_no_two_stamps_are_alike():
    stamps = Stamps(lambda: 0, lambda: START)
    first = stamps.used(batch([START, START, START + 400, START + 2000], 0)).t_ns
    second = stamps.used(batch([START + 1500, START + 1600], 10)).t_ns
    both = np.concatenate([first, second])
    assert (np.diff(both) >= 1000).all() and not (both % 1000).any()


def test_what_was_promised_to_have_come_stays_so():
    clock = Clock()
    clock.run(1.0)
    clock.at += 5 * S
    promised = clock.stamps.promised(clock.at - S)
    assert promised == START + clock.at - S
    late = clock.stamps.used(batch([START + 2 * S, START + 3 * S], clock.at)).t_ns
    assert (late > promised).all() and (np.diff(late) > 0).all()
