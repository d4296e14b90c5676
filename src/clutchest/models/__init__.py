"""Machines by name: the shipped ones, those that installed packages register, and a user's own."""

from __future__ import annotations

import importlib
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path
from typing import TYPE_CHECKING

from clutchest.errors import ClutchestError, nearest
from clutchest.models.python_file import digest_of, load_module

if TYPE_CHECKING:  # equations' machinery is loaded with the first machine
    from clutchest.models.machine import Machine

SHIPPED = ("dry_clutch", "alsd")  # each a package here, with its MACHINE
GROUP = "clutchest.machines"  # of entry points, each the name of a Machine


def names() -> tuple[str, ...]:
    """Every machine that a vehicle file can name without a file of its own."""
    return (*SHIPPED, *(entry.name for entry in entry_points(group=GROUP)))


@cache
def machine_of(name: str) -> Machine:
    """The machine of that name.  Raises ClutchestError for an unknown one, or an invalid one."""
    if name in SHIPPED:
        shipped: Machine = importlib.import_module(f"{__name__}.{name}").MACHINE
        return shipped
    from clutchest.models.machine import Machine

    entries = tuple(entry_points(group=GROUP, name=name))
    if not entries:
        raise ClutchestError(f"unknown model '{name}'" + nearest(name, names()))
    if len(entries) > 1:
        packages = ", ".join(entry.value for entry in entries)
        raise ClutchestError(f"machine '{name}' is registered twice: {packages}")
    (entry,) = entries
    try:
        registered = entry.load()
    except (Exception, SystemExit) as error:  # another package's code may raise anything
        text = " ".join(f"{type(error).__name__}: {error}".split())
        raise ClutchestError(f"machine '{name}': {entry.value}: {text}") from error
    if not isinstance(registered, Machine):
        raise ClutchestError(
            f"machine '{name}': {entry.value} is a {type(registered).__name__}, "
            "expected a clutchest.machine.Machine"
        )
    return _with_valid_effects(registered)


def shipped_machines() -> tuple[Machine, ...]:
    """The machines that clutchest ships."""
    return tuple(map(machine_of, SHIPPED))


def machine_in_file(path: Path, digest: str = "") -> Machine:
    """The machine of a user's own Python file, with the content of that ``digest``, default its
    present one: a machine in use stays the same while its file is edited.

    Raises ClutchestError where the file cannot be read, or defines none or several.
    """
    return _in_file(path, digest or digest_of(path))


@cache
def _in_file(path: Path, digest: str) -> Machine:
    """One machine per content of the file."""
    from clutchest.models.machine import Machine

    module = load_module(path, f"clutchest_machine_{digest[:16]}", "a machine", digest)
    machines = {id(value): value for value in vars(module).values() if isinstance(value, Machine)}
    if len(machines) != 1:
        names = ", ".join(f"'{machine.name}'" for machine in machines.values()) or "none"
        raise ClutchestError(
            f"{path}: expected one clutchest.machine.Machine at the top level, it defines {names}"
        )
    (machine,) = machines.values()
    try:
        return _with_valid_effects(machine)
    except ClutchestError as error:
        raise ClutchestError(f"{path}: {error}") from error


def _with_valid_effects(machine: Machine) -> Machine:
    """The same machine.  Raises ClutchestError for an effect that its equations cannot hold."""
    from clutchest.models.validate_effect import why_invalid

    declared = (*machine.effects.values(), *machine.unmodelled.values())
    for effect in (*declared, *(fault.effect for fault in machine.faults)):
        if wrong := why_invalid(effect, machine, {}):
            raise ClutchestError(f"machine '{machine.name}': effect '{effect.name}' {wrong}")
    return machine
