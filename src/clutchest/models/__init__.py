"""Machines by name: the shipped ones, those that installed packages register, and a user's own."""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Container
from functools import cache
from hashlib import sha256
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

from clutchest.errors import ClutchestError, file_like, nearest

if TYPE_CHECKING:  # equations' machinery is loaded with the first machine
    from clutchest.models.machine import Machine
    from clutchest.models.model import Model

SHIPPED = ("dry_clutch", "alsd")  # each a package here, with its MACHINE
GROUP = "clutchest.machines"  # of entry points, each the name of a Machine


def names() -> tuple[str, ...]:
    """Every machine that a vehicle file can name without a file of its own."""
    return (*SHIPPED, *(entry.name for entry in entry_points(group=GROUP)))


@cache
def machine_of(name: str) -> Machine:
    """The machine of that name.  Raises ClutchestError for an unknown one, or one that is wrong."""
    if name in SHIPPED:
        shipped: Machine = importlib.import_module(f"{__name__}.{name}").MACHINE
        return shipped
    from clutchest.models.machine import Machine

    for entry in entry_points(group=GROUP, name=name):
        registered = entry.load()
        if isinstance(registered, Machine):
            return registered
        raise ClutchestError(f"machine '{name}': {entry.value} is no clutchest.machine.Machine")
    raise ClutchestError(f"unknown model '{name}'" + nearest(name, names()))


def shipped_machines() -> tuple[Machine, ...]:
    """The machines that clutchest ships."""
    return tuple(map(machine_of, SHIPPED))


def machine_in_file(path: Path) -> Machine:
    """The machine of a user's own Python file.

    Raises ClutchestError where the file cannot be read, or defines none or several.
    """
    if not path.is_file():
        raise ClutchestError(f"{path}: no such file of a machine" + file_like(path))
    return _in_file(path, sha256(path.read_bytes()).hexdigest())


@cache
def _in_file(path: Path, digest: str) -> Machine:
    """One per content: a file that was changed is another machine."""
    spec = importlib.util.spec_from_file_location(f"clutchest_machine_{digest[:16]}", path)
    if spec is None or spec.loader is None:
        raise ClutchestError(f"{path}: expected a Python file (.py) with a machine")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except ClutchestError as error:
        raise ClutchestError(f"{path}: {error}") from error
    except Exception as error:  # whatever the user's file does wrong
        raise ClutchestError(f"{path}: {type(error).__name__}: {error}") from error
    return _only_machine(path, module)


def _only_machine(path: Path, module: ModuleType) -> Machine:
    from clutchest.models.machine import Machine

    machines = {id(value): value for value in vars(module).values() if isinstance(value, Machine)}
    if len(machines) != 1:
        raise ClutchestError(
            f"{path}: defines {len(machines)} machines, expected one clutchest.machine.Machine"
        )
    (machine,) = machines.values()
    return machine


def model_for(name: str, signals: Container[str]) -> Model:
    """The equations of the machine ``name`` in the form that these canonical signals can drive."""
    return machine_of(name).equations(signals)
