"""Fitting a vehicle file to a user's own logs: ``noise`` and ``all`` for every machine, and the
procedures that the vehicle's machine declares.

``clutchest.identify(…)`` calls :func:`identify_vehicle`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from clutchest.callable_room import call_by
from clutchest.checked import check, checked
from clutchest.errors import ClutchestError, nearest
from clutchest.progress import Progress, silent
from clutchest.shown import with_unit

if TYPE_CHECKING:
    from clutchest.identify.bench_records import Stated
    from clutchest.identify.fit import Fit
    from clutchest.models.machine import Machine
    from clutchest.reading import Logs
    from clutchest.signals import Signals
    from clutchest.vehicle import Vehicle

call_by(__name__, __name__, "identify_vehicle")

SURPRISING = 4.0  # standard deviations of what is stated, from which on a number is named
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


@checked
def identify_vehicle(
    name: str,
    signals: Signals | Logs,
    vehicle: Vehicle | str | Path,
    progress: Progress | None = None,
    holdout: Signals | Logs | None = None,
    benches: str | Sequence[str] | tuple[Stated, Stated] = (),
    refit: bool = False,
) -> Fit:
    """Run the procedure of that ``name`` on all drives of ``signals``.

    ``signals`` as read, or what ``read_log`` takes; ``vehicle`` as loaded, or what ``load_vehicle``
    takes.  ``holdout``: drives that only measure what the numbers are worth; ``benches``, for
    experiments: the name of one for all, or of one for each log or drive, those of ``holdout``
    after the others, or the sections of each drive of both; with ``refit`` these are also fitted by
    the likelihood of the filter's innovations.  Raises ClutchestError where the machine has no such
    procedure, or the drives cannot serve.
    """
    from clutchest.reading import as_signals
    from clutchest.vehicle import load_vehicle

    vehicle = load_vehicle(vehicle)
    machine = vehicle.machine
    if name not in (known := procedures(machine)):
        declares = f"; machine '{machine.name}' declares none" if len(known) == 2 else ""
        raise ClutchestError(f"unknown procedure '{name}'{declares}{nearest(name, known)}")
    drives = as_signals(signals, vehicle)
    held = None if holdout is None else as_signals(holdout, vehicle)
    stated = _stated(benches, (signals, holdout), drives, held, vehicle)
    fit = _identified(name, drives, vehicle, progress or silent, held, stated, refit)
    warnings = (*_contradicting(drives, vehicle), *fit.warnings, *_surprising(fit, vehicle))
    return replace(fit, begun=drives.begun, before=vehicle, warnings=warnings)


def _stated(
    benches: str | Sequence[str] | tuple[Stated, Stated],
    given: tuple[Any, Any],
    signals: Signals,
    holdout: Signals | None,
    vehicle: Vehicle,
) -> tuple[Stated, Stated]:
    """The benches of both, by name or as they are; a name for each log where paths were ``given``,
    else for each drive."""
    check("benches", benches, str | Sequence)
    some = [benches] if isinstance(benches, str) else benches
    names = [name for name in some if isinstance(name, str)]
    if len(names) < len(some):
        return benches  # type: ignore[return-value]
    from clutchest.identify.bench_records import sections_by_name, stated_sections

    logs, held_logs = (_paths(each) for each in given)
    if len(names) > 1 and len(names) == len(logs) + len(held_logs):
        own, rest = names[: len(logs)], names[len(logs) :]
        held = () if holdout is None else stated_sections(holdout, held_logs, rest, vehicle)
        return stated_sections(signals, logs, own, vehicle), held
    drives = [*signals.drives, *(holdout.drives if holdout else ())]
    every = sections_by_name(names, drives, vehicle)
    first = len(signals.drives)
    return every[:first], every[first:]


def _paths(given: Any) -> list[str]:
    """The logs that are ``given`` by path, none where anything else is."""
    each = [given] if isinstance(given, str | Path) else given
    if not isinstance(each, list | tuple) or not all(isinstance(e, str | Path) for e in each):
        return []
    return list(map(str, each))


def _contradicting(signals: Signals, vehicle: Vehicle) -> Iterator[str]:
    """Of drives whose signals cannot be right whatever the parameters are, in words."""
    from clutchest.estimate.impossible import impossible
    from clutchest.paths import names_of

    for drive in signals.drives:
        if found := impossible(drive, vehicle):
            of = f"{names_of(drive.sources)}: " if drive.sources else ""
            yield f"{of}{found.words}: {found.explanation}; no number of this fit counts"


def _surprising(fit: Fit, vehicle: Vehicle) -> Iterator[str]:
    """Of numbers far from what the vehicle file expects, in words."""
    for key, fitted in fit.parameters.items():
        before = vehicle.parameters.get(key)
        if before is None or not fitted.determined or not fitted.prior_std:
            continue
        apart = abs(fitted.value - before.value) / fitted.prior_std
        if apart > SURPRISING:
            was = with_unit(f"{before.value:.3g} ± {fitted.prior_std:.2g}", fitted.unit)
            yield (
                f"{key} = {fitted.value:.4g} lies {apart:.0f} standard deviations from the vehicle "
                f"file's {was}: another specimen, or a wrong unit, sign or bench"
            )


def _identified(
    name: str,
    signals: Signals,
    vehicle: Vehicle,
    progress: Progress,
    holdout: Signals | None,
    benches: tuple[Stated, Stated],
    refit: bool,
) -> Fit:
    """By the procedure of that ``name``, one of the machine's."""
    machine = vehicle.machine
    if name == NOISE:
        if holdout is not None:
            raise ClutchestError(
                f"procedure '{name}' takes no holdout: it states its own uncertainty"
            )
        from clutchest.identify.noise import identify_noise

        return identify_noise(signals, vehicle, progress)
    experiments = [e for e in machine.experiments if name in (e.name, ALL)]
    if experiments:
        from clutchest.identify.experiments import identify_experiments

        return identify_experiments(
            name, experiments, signals, vehicle, progress, holdout, benches, refit
        )
    if refit:
        raise ClutchestError(f"procedure '{name}' is fitted by the likelihood already")
    from clutchest.identify.parameters import identify_parameters, procedure_of

    return identify_parameters(procedure_of(name, vehicle), signals, vehicle, progress, holdout)
