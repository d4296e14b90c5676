from __future__ import annotations

import numpy as np
import pytest

from clutchest.can.deduplication import without_duplicates
from clutchest.can.frames import Flag, Frames
from samples import random_frames


def twice() -> Frames:
    """Twenty frames, each followed by itself."""
    frames = random_frames(20, seed=3)
    return Frames.concatenate([frames, frames]).sorted()


def test_what_is_recorded_twice_counts_once():
    kept = without_duplicates(twice())
    np.testing.assert_array_equal(kept.data, random_frames(20, seed=3).data)
    assert kept.passed_over == (("duplicate", 20),)


@pytest.mark.parametrize("column", ["t_ns", "channel", "id", "flags", "length", "data"])
def test_frames_that_differ_in_anything_are_two(column):
    frames = twice()
    later = slice(1, None, 2)
    if column == "t_ns":
        frames.t_ns[later] += 1
    elif column == "flags":
        frames.flags[later] ^= np.uint8(Flag.SENT)
    elif column == "length":  # zeros behind the payload are none of it
        frames.data[:], frames.length[:] = 0, 4
        frames.length[later] = 5
    elif column == "data":
        frames.data[later, 7] ^= 1
    else:
        getattr(frames, column)[later] ^= 1
    kept = without_duplicates(frames)
    assert len(kept) == 40 and kept.passed_over == ()


def test_others_of_the_same_time_may_lie_between():
    frames = random_frames(30, seed=4)
    frames.t_ns[:] = frames.t_ns[0]
    both = Frames.concatenate([frames, frames.take(np.array([0, 17]))])
    assert len(without_duplicates(both)) == 30
