"""The faults: one file per fault, each a class that watches for it."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from functools import cache

from clutchest.diagnosis.faults.fault import Alarm, Batch, ModelFault, StreamTest
from clutchest.vehicle import Vehicle

__all__ = ["Alarm", "Batch", "ModelFault", "StreamTest", "model_faults", "stream_tests"]


def _classes(base: type) -> list[type]:
    found = {}
    for info in pkgutil.iter_modules(__path__):
        module = importlib.import_module(f"{__name__}.{info.name}")
        for value in vars(module).values():
            if inspect.isclass(value) and issubclass(value, base) and value is not base:
                found[value.__module__, value.__name__] = value
    return [found[key] for key in sorted(found)]


@cache
def model_faults(model: str) -> tuple[ModelFault, ...]:
    """Every fault in this folder that the equations of a model show."""
    found = [c() for c in _classes(ModelFault)]
    return tuple(fault for fault in found if fault.model == model)


@cache
def kinds() -> tuple[type[StreamTest], ...]:
    """Every test of frames and single signals in this folder, by name of its kind."""
    found = {c.kind: c for c in _classes(StreamTest) if hasattr(c, "kind")}
    return tuple(found[kind] for kind in sorted(found))


def stream_tests(vehicle: Vehicle, per_1000h: float) -> list[StreamTest]:
    """A test for everything in this vehicle that may have one of these faults."""
    return [test for kind in kinds() for test in kind.of(vehicle, per_1000h)]
