"""The compiled filter is much faster than the one that runs sample by sample."""

from __future__ import annotations

import runpy
from pathlib import Path

import clutchest

BENCHMARK = Path(__file__).parents[1] / "benchmarks" / "engines.py"


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
