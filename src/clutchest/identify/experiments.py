"""Parameters from experiments on benches: the equation errors that a machine declares, made least.

An experiment uses the records of its own benches.  All uncertain parameters are estimated along,
within the vehicle file's spreads, so that a standard deviation contains what is not known of the
others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from clutchest.errors import ClutchestError
from clutchest.identify.bench_records import BenchRecords, Stated, bench_records, look_otherwise
from clutchest.identify.bench_refit import refits
from clutchest.identify.equation_errors import BenchPosterior, fit_errors
from clutchest.identify.fit import NOT_VALIDATED, ErrorChange, Fit, Fitted, Validation
from clutchest.identify.parameters import as_fitted
from clutchest.models.experiments import BenchExperiment, EquationErrors, Parameters
from clutchest.paths import names_of
from clutchest.progress import Progress
from clutchest.signals import Signals
from clutchest.vehicle import ParameterValue, Vehicle

MISFIT = 1.5  # of the noise: larger equation errors are reported
LOOK_FOR = "; look for a wrong sign or unit, or a stated noise that is far too small"
MISPLACED = 10.0  # of the noise: larger ones are refused if the data look like another bench's


@dataclass(frozen=True, slots=True)
class Reduced:
    """Experiments reduced to equation errors: pairs with the experiment of each, ``benches`` of
    their records; ``lacking``: why one that has a record gets nothing from it."""

    parts: tuple[tuple[BenchExperiment, EquationErrors], ...]
    benches: tuple[str, ...]
    lacking: tuple[tuple[BenchExperiment, str], ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def errors(self) -> list[EquationErrors]:
        """The equation errors of all."""
        return [part for _, part in self.parts]

    @property
    def experiments(self) -> list[BenchExperiment]:
        """Those that have a record, each once."""
        return list(dict.fromkeys(experiment for experiment, _ in (*self.parts, *self.lacking)))

    @property
    def nothing(self) -> str:
        """Why experiments that have a record get nothing from it, in words."""
        return "; ".join(dict.fromkeys(f"{e.name}: {why}" for e, why in self.lacking))

    def why(self, key: str) -> str:
        """Why no experiment has anything on a parameter; nothing where one has."""
        if any(key in experiment.parameters for experiment, _ in self.parts):
            return ""
        reasons = (w for experiment, w in self.lacking if key in experiment.parameters)
        return "; ".join(dict.fromkeys(reasons))

    def named(self, i: int) -> str:
        """The experiment of part ``i``; where it has several benches, with the part's."""
        experiment, _ = self.parts[i]
        several = len(
            {b for (e, _), b in zip(self.parts, self.benches, strict=True) if e is experiment}
        )
        return f"{experiment.name} on bench {self.benches[i]}" if several > 1 else experiment.name


def identify_experiments(
    name: str,
    experiments: Sequence[BenchExperiment],
    signals: Signals,
    vehicle: Vehicle,
    progress: Progress,
    holdout: Signals | None,
    benches: tuple[Stated, Stated] = ((), ()),
    refit: bool = False,
) -> Fit:
    """The parameters of ``experiments`` from the drives, all else within its spread.

    ``benches`` of each drive of ``signals`` and of ``holdout``, guessed where not stated; with
    ``refit`` each also by the likelihood of the filter's innovations.  Raises ClutchestError where
    no experiment finds what it needs, or the data contradict the bench that is stated.
    """
    records = bench_records(signals, vehicle, benches[0])
    progress("reducing", None)
    reduced = reduced_records(experiments, records)
    if not reduced.parts:
        raise ClutchestError(f"nothing could be determined; {reduced.nothing}")
    progress("fitting", None)
    posterior = _fit(reduced, records, vehicle)
    keys, wanted = _wanted(reduced, vehicle)
    sources = tuple(dict.fromkeys(s for drive in signals.drives for s in drive.sources))
    source = f"clutchest identify {name}, {names_of(sources)}"
    parameters = {key: _fitted(reduced, posterior, vehicle.parameters[key], key) for key in wanted}
    unfitted: list[str] = []
    if refit:
        parameters, unfitted = _refitted(parameters, experiments, records, vehicle, progress)
    changed = replace(vehicle, parameters=_changed(vehicle, parameters, source))
    warnings = [w for drive in signals.drives for w in drive.warnings]
    validation = None
    if holdout is None:
        warnings.append(NOT_VALIDATED)
    else:
        progress("validating", None)
        held = _held_out(experiments, bench_records(holdout, vehicle, benches[1]))
        validation = validate(holdout, held, vehicle, changed)
        if validation.gained < 0.0:
            warnings.append("on the log held out the new numbers are less probable than the old")
    misfits = _misfits(reduced, posterior, records, vehicle)
    warnings += [*_undetermined(parameters), *misfits, *unfitted]
    fixed = [key for key in keys if key not in wanted]
    exact = [f"{', '.join(fixed)}: no spread in the vehicle file, taken for exact"] if fixed else []
    return Fit(
        procedure=name,
        vehicle=changed,
        sources=sources,
        parameters=parameters,
        notes=(
            *records.notes,
            *reduced.notes,
            *_figures(reduced, posterior.parameters(vehicle)),
            *exact,
        ),
        warnings=tuple(dict.fromkeys(warnings)),
        draw=partial(_draw, reduced, posterior, vehicle),
        validation=validation,
    )


def reduced_records(experiments: Sequence[BenchExperiment], records: BenchRecords) -> Reduced:
    """Every experiment on every record of its benches.

    Raises ClutchestError where none of them has a record with the signals that it needs.
    """
    parts, benches, lacking, notes = [], [], [], []
    for experiment in experiments:
        of = records.on(experiment.benches)
        if not of:
            notes.append(
                f"{experiment.name} needs a log from bench {' or '.join(experiment.benches)}; "
                f"these are from {', '.join(records.benches) or 'none that is recognised'}"
            )
        for record in of:
            if missing := record.lacks(experiment.signals):
                notes.append(f"{experiment.name}: the log has no {', '.join(missing)}")
                continue
            result = experiment.reduce(record)
            if isinstance(result, str):
                lacking.append((experiment, result))
            else:
                parts.append((experiment, result))
                benches.append(record.bench)
    if not parts and not lacking:
        raise ClutchestError("; ".join(dict.fromkeys(notes)))
    return Reduced(tuple(parts), tuple(benches), tuple(lacking), tuple(dict.fromkeys(notes)))


def _held_out(experiments: Sequence[BenchExperiment], records: BenchRecords) -> Reduced:
    """Every experiment on the records held out.

    Raises ClutchestError where none gets anything from them.
    """
    try:
        reduced = reduced_records(experiments, records)
    except ClutchestError as error:
        raise ClutchestError(f"the log held out: {error}") from error
    if not reduced.parts:
        raise ClutchestError(f"the log held out: {reduced.nothing}")
    return reduced


def _fit(reduced: Reduced, records: BenchRecords, vehicle: Vehicle) -> BenchPosterior:
    """Raises ClutchestError where equations miss by far on a bench that the data contradict."""
    posterior = fit_errors(reduced.errors, vehicle)
    worst = max(range(len(posterior.scale)), key=lambda i: posterior.scale[i])
    if (scale := posterior.scale[worst]) > MISPLACED and (
        words := look_otherwise(records, vehicle)
    ):
        raise ClutchestError(
            f"{reduced.named(worst)}: the equations miss by {scale:.0f} times the noise; "
            + "; ".join(words)
        )
    return posterior


def _wanted(reduced: Reduced, vehicle: Vehicle) -> tuple[list[str], list[str]]:
    """The keys of all parameters of the experiments, and of those that may be fitted.

    Raises ClutchestError where none has a spread.
    """
    keys = list(dict.fromkeys(key for e in reduced.experiments for key in e.parameters))
    wanted = [key for key in keys if vehicle.parameters[key].spread > 0]
    if not wanted:
        raise ClutchestError(
            f"{vehicle.path.name}: none of {', '.join(keys)} has a spread: nothing may be fitted"
        )
    return keys, wanted


def _fitted(
    reduced: Reduced, posterior: BenchPosterior, before: ParameterValue, key: str
) -> Fitted:
    fitted = as_fitted(before, *(posterior.of(key) or (before.value, before.spread)))
    why = reduced.why(key)
    return replace(fitted, why=why) if why else fitted


def _undetermined(parameters: Mapping[str, Fitted]) -> list[str]:
    """That some of them stay where they were."""
    keys = [key for key, fitted in parameters.items() if not fitted.determined]
    stay = "they stay" if len(keys) > 1 else "it stays"
    return [f"these logs do not determine {', '.join(keys)}: {stay} at the prior"] if keys else []


def _refitted(
    parameters: dict[str, Fitted],
    experiments: Sequence[BenchExperiment],
    records: BenchRecords,
    vehicle: Vehicle,
    progress: Progress,
) -> tuple[dict[str, Fitted], list[str]]:
    """The same with what the likelihood makes of each, and which record gave nothing."""
    benches = dict.fromkeys(bench for experiment in experiments for bench in experiment.benches)
    beside, unfitted = refits(list(parameters), list(benches), records, vehicle, progress)
    return {k: replace(f, refit=beside.get(k)) for k, f in parameters.items()}, unfitted


def _changed(
    vehicle: Vehicle, parameters: dict[str, Fitted], source: str
) -> dict[str, ParameterValue]:
    """The vehicle's parameters with those that are determined."""
    return dict(vehicle.parameters) | {
        key: replace(vehicle.parameters[key], value=f.value, spread=f.std or 0.0, source=source)
        for key, f in parameters.items()
        if f.determined
    }


def _misfits(
    reduced: Reduced, posterior: BenchPosterior, records: BenchRecords, vehicle: Vehicle
) -> list[str]:
    """Equations that miss by more than the noise, in words; where by far, with what to look for."""
    far = ""
    if max(posterior.scale) > MISPLACED:
        far = "; ".join((LOOK_FOR, *look_otherwise(records, vehicle, partly=True)))
    return [
        f"{reduced.named(i)}: the equations miss by {scale:.1f} times the noise; standard "
        f"deviations are as many times larger{far if scale > MISPLACED else ''}"
        for i, scale in enumerate(posterior.scale)
        if scale > MISFIT
    ]


def _figures(reduced: Reduced, p: Parameters) -> list[str]:
    return [f"{e.name}: {words}" for e, part in reduced.parts for words in part.figures(p)]


def validate(holdout: Signals, reduced: Reduced, before: Vehicle, after: Vehicle) -> Validation:
    """Numbers in which the vehicles differ, on ``holdout``: all others are fitted to it within
    their spreads, once with the one and once with the other."""
    moved = [k for k, p in after.parameters.items() if p.value != before.parameters[k].value]
    old, new = (
        fit_errors(reduced.errors, vehicle, moved, widened=False, mean=False)
        for vehicle in (before, after)
    )
    errors = []
    names = [reduced.named(i) for i in range(len(reduced.parts))]
    for name in dict.fromkeys(names):
        own = [i for i, of in enumerate(names) if of == name]
        rms = [_rms(reduced, own, *by) for by in ((old, before), (new, after))]
        errors.append(
            ErrorChange(name.replace(" on bench ", "_"), f"the equations of {name}", "σ", *rms)
        )
    logs = dict.fromkeys(Path(s).name for drive in holdout.drives for s in drive.sources)
    return Validation(tuple(logs), tuple(errors), 0.5 * (old.cost - new.cost))


def _rms(
    reduced: Reduced, parts: Sequence[int], posterior: BenchPosterior, vehicle: Vehicle
) -> float:
    """Root mean square of the equation errors of some ``parts``."""
    p = posterior.parameters(vehicle)
    errors = [reduced.errors[i].errors(p, posterior.own[i]) for i in parts]
    return float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))


def _draw(reduced: Reduced, posterior: BenchPosterior, before: Vehicle, folder: Path) -> None:
    from clutchest.identify.fit_pictures import draw_curves

    was = {key: p.value for key, p in before.parameters.items()}
    now = posterior.parameters(before)
    curves = [
        (curve, own)
        for part, own in zip(reduced.errors, posterior.own, strict=True)
        for curve in part.curves
    ]
    draw_curves(curves, was, now, folder)
