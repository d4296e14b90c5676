"""Intervals of `identify noise` against drives whose noise and delays are known."""

from __future__ import annotations

import runpy
from itertools import chain
from pathlib import Path

import numpy as np
import pytest

TOO_SHORT = {"motor_position.noise_ar"}  # docs/identify.md: hardly a window lies between quiet ones
BENCHMARK = Path(__file__).parents[2] / "benchmarks" / "noise.py"


@pytest.mark.statistics
def test_intervals_hold_what_is_true():
    """40 trucks with other noise, colour and delays: coverage and bias of every number."""
    noise = runpy.run_path(str(BENCHMARK))
    numbers = chain.from_iterable(noise["found"]((seed, ())) for seed in range(40))
    rows = noise["table"](numbers)
    print(noise["show"](rows))
    short = {key for key, row in rows.items() if row["high"] < 0.95}
    assert short <= TOO_SHORT
    off = [key for key, r in rows.items() if abs(r["bias"]) > 0.5 + 2 / np.sqrt(r["count"])]
    assert not off
