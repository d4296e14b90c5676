"""Values of a model's expressions along a drive."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from concurrent.futures import TimeoutError as Waits

import numpy as np
import pytest

import clutchest
from clutchest.casadi_later import symbolic


def test_one_thread_at_a_time_works_on_expressions_that_threads_share():
    truck = clutchest.load_vehicle("truck")
    e = truck.machine.to_fit(truck.signals).expressions()
    moments = [np.ones((3, each.numel())) for each in (e.x, e.u, e.w)]
    numbers = [np.ones(each.numel()) for each in (e.p, e.g)]
    with ThreadPoolExecutor(1) as other:
        with symbolic:
            values = other.submit(e.along, e.rate, *moments, *numbers)
            with pytest.raises(Waits):
                values.result(0.2)
        assert values.result(60.0).shape == (e.rate.numel(), 3)
