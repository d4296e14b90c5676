"""The folders of others' machines, for tests."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

from clutchest.vehicle import Vehicle, load_vehicle

MACHINES = Path(__file__).parents[1] / "machines"
VEHICLES = {
    "emps": "emps.toml",
    "tanks": "tanks.toml",
    "servo": "sts3215.toml",
    "plate": "plate.toml",
}


def module(machine: str, name: str) -> ModuleType:
    """A file of a machine's folder as a module."""
    path = MACHINES / machine / f"{name}.py"
    spec = importlib.util.spec_from_file_location(f"{machine}_{name}", path)
    assert spec is not None and spec.loader is not None
    made = sys.modules[spec.name] = importlib.util.module_from_spec(spec)  # as dataclasses need
    spec.loader.exec_module(made)
    return made


def vehicle(machine: str) -> Vehicle:
    return load_vehicle(MACHINES / machine / VEHICLES[machine], trust=True)
