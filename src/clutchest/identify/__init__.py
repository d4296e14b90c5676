"""Fitting a vehicle file to a user's own logs: one file per procedure, listed here."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING

from clutchest.errors import ClutchestError, nearest

if TYPE_CHECKING:
    from clutchest.identify.fit import Fit
    from clutchest.signals import Signals
    from clutchest.vehicle import Vehicle

Progress = Callable[[str, float | None], None]


@dataclass(frozen=True, slots=True)
class Procedure:
    """One way to learn numbers of the vehicle file from a log.

    ``what`` it finds, in a few words; ``module`` has ``identify(signals, vehicle, progress)``,
    loaded when it is first asked for.
    """

    name: str
    what: str
    module: str

    def __call__(self, signals: Signals, vehicle: Vehicle, progress: Progress) -> Fit:
        """Run it on all drives of ``signals``.  Raises ClutchestError if they cannot serve."""
        fit: Fit = import_module(self.module).identify(signals, vehicle, progress)
        return fit


PROCEDURES = {
    p.name: p
    for p in (
        Procedure(
            "noise",
            "noise, its AR(1) coefficient and the delay of every signal, from any healthy log",
            "clutchest.identify.noise",
        ),
    )
}


def procedure(name: str) -> Procedure:
    """The procedure of that name.  Raises ClutchestError naming the nearest one."""
    if name not in PROCEDURES:
        raise ClutchestError(f"unknown procedure '{name}'" + nearest(name, PROCEDURES))
    return PROCEDURES[name]
