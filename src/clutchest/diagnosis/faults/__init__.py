"""Tests of frames and single signals: one file per fault."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from functools import cache

from clutchest.diagnosis.faults.stream_test import Alarm, Batch, StreamTest
from clutchest.vehicle import Vehicle

__all__ = ["Alarm", "Batch", "StreamTest", "kinds", "stream_tests"]


@cache
def kinds() -> tuple[type[StreamTest], ...]:
    """Every test in this folder, in the order of their kinds' names."""
    tests: dict[str, type[StreamTest]] = {}
    for info in pkgutil.iter_modules(__path__):
        module = importlib.import_module(f"{__name__}.{info.name}")
        for value in vars(module).values():
            if inspect.isclass(value) and issubclass(value, StreamTest) and hasattr(value, "kind"):
                tests[value.kind] = value
    return tuple(tests[kind] for kind in sorted(tests))


def stream_tests(vehicle: Vehicle, per_1000h: float) -> list[StreamTest]:
    """One test for each message or signal of this vehicle and each fault that it may have."""
    return [test for kind in kinds() for test in kind.of(vehicle, per_1000h)]
