"""Fitting a vehicle file to a user's own logs: ``noise`` and ``all`` for every machine, and the
procedures that the vehicle's machine declares."""

from __future__ import annotations

from typing import TYPE_CHECKING

from clutchest.errors import ClutchestError, nearest
from clutchest.progress import Progress

if TYPE_CHECKING:
    from clutchest.identify.bench_records import Stated
    from clutchest.identify.fit import Fit
    from clutchest.models.machine import Machine
    from clutchest.signals import Signals
    from clutchest.vehicle import Vehicle

NOISE = "noise"
ALL = "all"
OF_EVERY_MACHINE = {
    NOISE: "noise, its AR(1) coefficient and the delay of every signal, from any healthy log",
    ALL: "every parameter that has a spread, from all of a log",
}


def procedures(machine: Machine) -> dict[str, str]:
    """Name → what it determines, of every procedure for a machine."""
    declared = {p.name: p.what for p in machine.procedures}
    declared |= {experiment.name: experiment.what for experiment in machine.experiments}
    return {NOISE: OF_EVERY_MACHINE[NOISE], **declared, ALL: OF_EVERY_MACHINE[ALL]}


def identify(
    name: str,
    signals: Signals,
    vehicle: Vehicle,
    progress: Progress,
    holdout: Signals | None = None,
    benches: tuple[Stated, Stated] = ((), ()),
) -> Fit:
    """Run the procedure of that ``name`` on all drives of ``signals``.

    ``holdout``: drives that only measure what the numbers are worth; ``benches`` of each drive of
    both, for experiments.  Raises ClutchestError where the machine has no such procedure, or the
    drives cannot serve.
    """
    machine = vehicle.machine
    if name not in (known := procedures(machine)):
        declares = f"; machine '{machine.name}' declares none" if len(known) == 2 else ""
        raise ClutchestError(f"unknown procedure '{name}'{declares}{nearest(name, known)}")
    if name == NOISE:
        if holdout is not None:
            raise ClutchestError(
                f"procedure '{name}' takes no --holdout: it states its own uncertainty"
            )
        from clutchest.identify.noise import identify_noise

        return identify_noise(signals, vehicle, progress)
    experiments = [e for e in machine.experiments if name in (e.name, ALL)]
    if experiments:
        from clutchest.identify.experiments import identify_experiments

        return identify_experiments(name, experiments, signals, vehicle, progress, holdout, benches)
    from clutchest.identify.parameters import identify_parameters, procedure_of

    return identify_parameters(procedure_of(name, vehicle), signals, vehicle, progress, holdout)
