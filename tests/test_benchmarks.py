"""The compiled filter is much faster than the one that runs sample by sample."""

from __future__ import annotations

import os
import runpy
import shutil
from pathlib import Path

import pytest

import clutchest

BENCHMARK = Path(__file__).parents[1] / "benchmarks" / "engines.py"


@pytest.mark.slow
def test_kernel_is_a_hundred_times_faster_than_filterpy():
    """About 200 is usual; the quickest turn of each tells, whatever else the machine does."""
    truck = clutchest.load_vehicle("truck")
    drive = clutchest.simulate(truck, "city", 1, duration=30.0)
    result = runpy.run_path(str(BENCHMARK))["compare"](drive, truck, repeats=4)
    online, kernel, _, signatures = (min(times) for times in result["us_per_event"].values())
    assert result["events"] > 4000
    assert result["difference"] < 1e-9
    assert online / kernel >= 100.0
    assert signatures > kernel


@pytest.mark.skipif(shutil.which(os.environ.get("CC", "cc")) is None, reason="no C compiler")
def test_a_filter_written_by_hand_in_c_agrees_and_is_hardly_faster():
    """Measured: 1.1 times; the quickest turn of each tells."""
    truck = clutchest.load_vehicle("truck")
    drive = clutchest.simulate(truck, "city", 1, duration=30.0)
    path = BENCHMARK.with_name("by_hand.py")
    result = runpy.run_path(str(path))["compare"](drive, truck, repeats=5)
    dense, kernel, by_hand, with_outputs = (min(t) for t in result["us_per_event"].values())
    assert result["difference"] < 1e-9
    assert kernel < 2.0 * by_hand and dense < 2.0 * with_outputs
