"""From the most probable numbers to a vehicle file: what a procedure found of its parameters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from clutchest.errors import ClutchestError
from clutchest.identify.fit import Fit, Fitted
from clutchest.identify.likelihood import Posterior, most_probable, problem_of
from clutchest.identify.validation import validate
from clutchest.progress import Progress
from clutchest.signals import Signals
from clutchest.vehicle import Vehicle

Z = 1.96  # standard deviations of a 95 % interval
TOLD = 0.8  # of the prior's standard deviation: less must be left for a log to have told anything

CURVE = ("torque_cubic", "torque_quadratic", "kiss_point")
FRICTION = "start of friction"

Draw = Callable[[Posterior, Vehicle, Path], None]


def identify_parameters(
    name: str,
    keys: Sequence[str],
    draw: Draw,
    signals: Signals,
    vehicle: Vehicle,
    progress: Progress,
    holdout: Signals | None,
    sensor: str | None = None,
) -> Fit:
    """The ``keys`` of the vehicle file as the drives tell them, all else within its spread.

    ``holdout``: drives that only measure what the numbers are worth.  With ``sensor`` its readings
    alone count.  Raises ClutchestError where the drives tell of no parameter at all.
    """
    warnings = [w for drive in signals.drives for w in drive.warnings]
    if holdout is None:
        warnings.append("not validated: that takes a log that is not fitted, --holdout LOG")
    wanted = [key for key in keys if vehicle.parameters[key].spread > 0]
    fixed = [key for key in keys if key not in wanted]
    if not wanted:
        raise ClutchestError(
            f"{vehicle.path.name}: none of {', '.join(keys)} has a spread: nothing may be fitted"
        )
    posterior = posterior_of(keys, signals, vehicle, sensor, progress)
    sources = tuple(dict.fromkeys(s for drive in signals.drives for s in drive.sources))
    source = f"clutchest identify {name}, {', '.join(Path(s).name for s in sources)}"
    parameters, found = {}, dict(vehicle.parameters)
    for key in wanted:
        parameters[key] = told(posterior, key)
        if parameters[key].determined:
            found[key] = replace(
                found[key],
                value=parameters[key].value,
                spread=parameters[key].std or 0.0,
                source=source,
            )
    unsure = [key for key, fitted in parameters.items() if not fitted.determined]
    if unsure:
        stay = "they stay" if len(unsure) > 1 else "it stays"
        warnings.append(f"these logs do not determine {', '.join(unsure)}: {stay} at the prior")
    notes = [f"{', '.join(fixed)}: no spread in the vehicle file, taken for exact"] if fixed else []
    changed = replace(vehicle, parameters=found)
    validation = None
    if holdout is not None:
        progress("validating", None)
        validation = validate(holdout, vehicle, changed)
        if validation.gained < 0.0:
            warnings.append("on the log held out the new numbers are less probable than the old")
    return Fit(
        procedure=name,
        vehicle=changed,
        sources=sources,
        parameters=parameters,
        notes=tuple(notes),
        warnings=tuple(dict.fromkeys(warnings)),
        draw=partial(draw, posterior, changed),
        validation=validation,
    )


def posterior_of(
    keys: Sequence[str],
    signals: Signals,
    vehicle: Vehicle,
    sensor: str | None = None,
    progress: Progress | None = None,
) -> Posterior:
    """All numbers of these drives, where ``keys`` are wanted."""
    problem = problem_of(signals, vehicle, sensor, progress)
    if set(CURVE) <= set(keys):  # friction is relative to the curve: a curve that is fitted has 1
        problem = problem.holding(FRICTION)
    return most_probable(problem, progress)


def told(posterior: Posterior, key: str) -> Fitted:
    """Value ± standard deviation, or that the logs leave it where it was."""
    before = posterior.problem.vehicle.parameters[key]
    value, std = posterior.of(key) or (before.value, before.spread)
    if std > TOLD * before.spread:
        why = f"these logs lower its standard deviation by {100 * (1 - std / before.spread):.0f} %"
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
