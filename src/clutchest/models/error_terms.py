"""Errors of equations that no effect describes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from clutchest.models.symbols import Sensor

Change = Callable[[Any, Any], Any]  # (value, error in units) → changed value


@dataclass(frozen=True, slots=True)
class ErrorTerm:
    """An error of ``equation``, of any size at any time.

    ``changes``: quantity → what one unit of error does to it; or ``late``: a signal and by how many
    s one unit delays it.  ``covariates``: what the error may correlate with, anything unless given:
    a sensor's error correlates with what its reading is made from.  ``slow``: what it does adds up
    over minutes, so that quick changes of it have no visible effect.  For people, one unit of error
    is ``size`` times a ``unit``.
    """

    equation: str
    changes: Mapping[str, Change] = field(default_factory=lambda: MappingProxyType({}))
    late: tuple[str, float] | None = None
    covariates: tuple[str, ...] = ()
    slow: bool = False
    size: float = 1.0
    unit: str = "units of the error term"

    def readings(self, sensors: Sequence[Sensor]) -> tuple[int, ...]:
        """Indices of the ``sensors`` whose readings it changes."""
        return tuple(i for i, s in enumerate(sensors) if f"{s.name}_reading" in self.changes)
