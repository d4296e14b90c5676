"""From the most probable numbers to a vehicle file: the parameters of a procedure."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from clutchest.errors import ClutchestError
from clutchest.identify.fit import NOT_VALIDATED, Fit, Fitted
from clutchest.identify.likelihood import Posterior, most_probable, problem_of
from clutchest.identify.validation import validate
from clutchest.inference.between_drives import unlike
from clutchest.models.procedures import Procedure
from clutchest.paths import names_of
from clutchest.progress import Progress
from clutchest.signals import Signals
from clutchest.vehicle import ParameterValue, Vehicle

Z = 1.96  # standard deviations of a 95 % interval
DETERMINED = 0.8  # of the prior's standard deviation: less must be left for a log to determine it


def procedure_of(name: str, vehicle: Vehicle) -> Procedure:
    """The machine's procedure of that name; of any other name, one that determines every parameter
    with a spread, but those whose spread is the prior of a state."""
    machine = vehicle.machine
    declared = {procedure.name: procedure for procedure in machine.procedures}
    if name in declared:
        return declared[name]
    priors = {state.prior for state in machine.states}
    keys = [key for key, p in vehicle.parameters.items() if p.spread > 0 and key not in priors]
    return Procedure(name, "", tuple(keys), pictures=machine.pictures)


def identify_parameters(
    procedure: Procedure,
    signals: Signals,
    vehicle: Vehicle,
    progress: Progress,
    holdout: Signals | None,
) -> Fit:
    """The parameters of a procedure as the drives determine them, all else within its spread.

    ``holdout``: drives that only measure what the numbers are worth.  Raises ClutchestError where
    the drives determine no parameter at all.
    """
    keys = procedure.parameters
    wanted = [key for key in keys if vehicle.parameters[key].spread > 0]
    fixed = [key for key in keys if key not in wanted]
    if not wanted:
        raise ClutchestError(
            f"{vehicle.path.name}: none of {', '.join(keys)} has a spread: nothing may be fitted"
        )
    posterior = posterior_of(procedure, signals, vehicle, progress)
    warnings = [words for drive in signals.drives for words in drive.warnings]
    warnings += [NOT_VALIDATED] if holdout is None else []
    warnings += unlike(posterior.objective, posterior.fit, posterior.problem.nuisances)
    sources = tuple(dict.fromkeys(s for drive in signals.drives for s in drive.sources))
    source = f"clutchest identify {procedure.name}, {names_of(sources)}"
    parameters, changed_to = {}, dict(vehicle.parameters)
    for key in wanted:
        parameters[key] = determined(posterior, key)
        if parameters[key].determined:
            changed_to[key] = replace(
                changed_to[key],
                value=parameters[key].value,
                spread=parameters[key].std or 0.0,
                source=source,
            )
    undetermined = [key for key, fitted in parameters.items() if not fitted.determined]
    if undetermined:
        stay = "they stay" if len(undetermined) > 1 else "it stays"
        warnings.append(
            f"these logs do not determine {', '.join(undetermined)}: {stay} at the prior"
        )
    notes = [f"{', '.join(fixed)}: no spread in the vehicle file, taken for exact"] if fixed else []
    changed = replace(vehicle, parameters=changed_to)
    validation = None
    if holdout is not None:
        progress("validating", None)
        validation = validate(holdout, vehicle, changed)
        if validation.gained < 0.0:
            warnings.append("on the log held out the new numbers are less probable than the old")
    return Fit(
        procedure=procedure.name,
        vehicle=changed,
        sources=sources,
        parameters=parameters,
        notes=tuple(notes),
        warnings=tuple(dict.fromkeys(warnings)),
        draw=partial(_draw, procedure, posterior, changed),
        validation=validation,
    )


def posterior_of(
    procedure: Procedure,
    signals: Signals,
    vehicle: Vehicle,
    progress: Progress | None = None,
) -> Posterior:
    """All numbers of these drives, where those of a procedure are wanted."""
    problem = problem_of(signals, vehicle, procedure.sensor, procedure.effects, progress)
    for state, parameters in vehicle.machine.relative_states.items():
        if set(parameters) <= set(procedure.parameters):
            problem = problem.holding(f"start of {state}")
    return most_probable(problem, progress)


def _draw(procedure: Procedure, posterior: Posterior, vehicle: Vehicle, folder: Path) -> None:
    from clutchest.identify.fit_pictures import draw

    draw(procedure, posterior, vehicle, folder)


def determined(posterior: Posterior, key: str) -> Fitted:
    """Value ± standard deviation, or that the logs leave it where it was."""
    before = posterior.problem.vehicle.parameters[key]
    return as_fitted(before, *(posterior.of(key) or (before.value, before.spread)))


def as_fitted(before: ParameterValue, value: float, std: float) -> Fitted:
    """The same by what a parameter was, and its most probable value ± standard deviation."""
    if std > DETERMINED * before.spread:
        smaller = 100 * (1 - std / before.spread)
        why = f"not identifiable from these logs (standard deviation only {smaller:.0f} % smaller)"
        return Fitted(
            before.value,
            before.unit,
            std=before.spread,
            prior_std=before.spread,
            determined=False,
            why=why,
        )
    return Fitted(
        _short(value),
        before.unit,
        std=_short(std),
        low=_short(value - Z * std),
        high=_short(value + Z * std),
        prior_std=before.spread,
    )


def _short(value: float) -> float:
    """To as many digits as matter."""
    return float(f"{value:.7g}") if np.isfinite(value) else value
