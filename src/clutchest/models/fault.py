"""Faults of a machine, declared: what its equations show, and which signals follow which."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from clutchest.models.effects.effect import Effect, Number


@dataclass(frozen=True, slots=True)
class ModelFault:
    """A fault that the equations show: the gain ``key`` of ``effect`` is not 0.

    ``name`` as the output files name it; ``size``, in the gain's unit, the smallest that matters;
    ``fmi`` the failure mode identifiers (SAE J1939-73) where the gain is above and where it is
    below 0.  ``grows_as``: fault → amount per hour and unit of this one: a rate that starts at the
    hour h of a drive equals this rate from the drive's start less ``amount · h`` of that fault.
    """

    name: str
    effect: Effect
    key: str
    size: float
    fmi: tuple[int, int]
    grows_as: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))

    @property
    def gain(self) -> Number:
        """The gain: its unit and its largest plausible sizes."""
        return next(number for number in self.effect.gains if number.key == self.key)


@dataclass(frozen=True, slots=True)
class Follower:
    """A signal that must move as its ``leader`` does beyond ``stroke`` (the signals' unit); where
    it does not, the ``subject`` sticks."""

    subject: str
    leader: str
    follower: str
    stroke: float


@dataclass(frozen=True, slots=True)
class Actuator:
    """A ``subject`` whose ``drive`` (a signal: voltage, current, pressure) moves its ``output``: a
    rise of the drive from a to b that lasts moves it by at least ``least(parameters, a, b)``, in
    the output's unit, 0 where friction may hold it; where it does not move, the subject sticks."""

    subject: str
    drive: str
    output: str
    least: Callable[[Mapping[str, float], float, float], float]


@dataclass(frozen=True, slots=True)
class Demand:
    """What is asked of ``subject``: the ``demands`` are signals in its ``unit``, ``released`` is a
    pedal or lever in %, 0 where nothing is asked for.  The parameter ``full_scale`` is the
    subject's largest value."""

    subject: str
    unit: str
    demands: tuple[str, ...]
    released: str
    full_scale: str


def faults_in(package: str) -> tuple[ModelFault, ...]:
    """The declaration ``FAULT`` of every file of a package, in the order of the files' names."""
    folder = importlib.import_module(package)
    names = sorted(info.name for info in pkgutil.iter_modules(folder.__path__))
    return tuple(importlib.import_module(f"{package}.{name}").FAULT for name in names)
