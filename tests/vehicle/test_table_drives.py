"""A table is cut where no signal has a sample, whichever of them has the samples."""

from __future__ import annotations

import numpy as np
import pytest

from clutchest.reading.table_drives import drives_of
from clutchest.signals import Signal, Signals


@pytest.mark.parametrize("seed", range(20))
def test_cuts_are_the_gaps_of_all_times_together(seed):
    rng = np.random.default_rng(seed)
    times = {
        name: np.sort(rng.choice(rng.integers(0, 400, 12), rng.integers(0, 8))).astype(float)
        for name in "abc"
    }
    times["d"] = np.array([0.0])
    signals = {name: Signal.of(name, "1", time, time) for name, time in times.items()}
    end = max(float(time.max(initial=0.0)) for time in times.values())
    drives = drives_of(Signals(signals, end=end), 50.0)
    together = np.unique(np.concatenate(list(times.values())))
    expected = np.split(together, 1 + np.flatnonzero(np.diff(together) > 50.0))
    found = [
        np.unique(np.concatenate([signal.value for signal in drive.values()])) for drive in drives
    ]
    assert len(found) == len(expected)
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(one, other)
