"""Fitting a vehicle file to a user's own logs: one file per procedure, listed here."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING

from clutchest.errors import ClutchestError, nearest
from clutchest.progress import Progress

if TYPE_CHECKING:
    from clutchest.identify.fit import Fit
    from clutchest.signals import Signals
    from clutchest.vehicle import Vehicle


@dataclass(frozen=True, slots=True)
class Procedure:
    """One way to learn numbers of the vehicle file from a log.

    ``what`` it finds, in a few words; ``module`` has ``identify(signals, vehicle, progress)``,
    loaded when it is first asked for.  If it ``validates``, that takes ``holdout`` too: drives that
    only measure what the numbers are worth.  It is a procedure for the clutch ``model``.
    """

    name: str
    what: str
    module: str
    validates: bool = True
    model: str = "dry_clutch"

    def __call__(
        self,
        signals: Signals,
        vehicle: Vehicle,
        progress: Progress,
        holdout: Signals | None = None,
    ) -> Fit:
        """Run it on all drives of ``signals``.  Raises ClutchestError if they cannot serve."""
        if self.model != vehicle.model:
            raise ClutchestError(
                f"procedure '{self.name}' is there for '{self.model}' only, "
                f"not for '{vehicle.model}'"
            )
        run = import_module(self.module).identify
        if holdout is not None and not self.validates:
            raise ClutchestError(
                f"procedure '{self.name}' takes no --holdout: it says itself how sure it is"
            )
        fit: Fit = (
            run(signals, vehicle, progress, holdout)
            if self.validates
            else run(signals, vehicle, progress)
        )
        return fit


PROCEDURES = {
    p.name: p
    for p in (
        Procedure(
            "noise",
            "noise, its AR(1) coefficient and the delay of every signal, from any healthy log",
            "clutchest.identify.noise",
            validates=False,
        ),
        Procedure(
            "torque-curve",
            "a, b and x_ISP of the torque curve, from ramps of the position",
            "clutchest.identify.torque_curve",
        ),
        Procedure(
            "expansion",
            "expansion with the body's temperature, from heating and cool-down",
            "clutchest.identify.expansion",
        ),
        Procedure(
            "thermal",
            "capacities and conductances of body and housing, from heating and cool-down",
            "clutchest.identify.thermal",
        ),
        Procedure(
            "disc",
            "the disc's expansion, capacity and conductance, from slips that heat it",
            "clutchest.identify.disc",
        ),
        Procedure(
            "all",
            "every parameter that has a spread, from all of a log",
            "clutchest.identify.all_parameters",
        ),
    )
}


def procedure(name: str) -> Procedure:
    """The procedure of that name.  Raises ClutchestError naming the nearest one."""
    if name not in PROCEDURES:
        raise ClutchestError(f"unknown procedure '{name}'" + nearest(name, PROCEDURES))
    return PROCEDURES[name]
