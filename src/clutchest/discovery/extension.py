"""The vehicle with what was identified in its model, and how well that is known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import inf
from pathlib import Path

import numpy as np

from clutchest.discovery.cause_set import CauseSet
from clutchest.discovery.residual_curves import Curve
from clutchest.discovery.result import Size
from clutchest.discovery.search import Search
from clutchest.inference.map_fit import covariance
from clutchest.inference.problem import Problem
from clutchest.inference.unknowns import StatedGain
from clutchest.models.curve_effect import covariates_of_curve
from clutchest.models.effects import effects_of_file
from clutchest.models.effects.effect import TIME
from clutchest.models.error_curve import ErrorCurve, free_name, matrix, numbers_of, rounded
from clutchest.models.machine import Machine
from clutchest.models.model import Model
from clutchest.signals import Floats
from clutchest.vehicle import Vehicle

Sizes = Mapping[str, Mapping[str, Size]]  # effect → key → number


def extend(
    problem: Problem, sizes: Sizes, curve: Curve | None, own: Sequence[Path]
) -> tuple[Vehicle, str | None]:
    """The problem's vehicle with effects of these ``sizes`` in its model, or with a curve, and the
    curve's name; ``own``: the user's files, which may be needed for it."""
    vehicle, name = problem.vehicle, None
    effects, spreads = dict(vehicle.effects), dict(vehicle.effects_spread)
    curves, files = _corrected_curves(vehicle, sizes), list(vehicle.effects_files)
    if curve is not None:
        name = free_name(tuple(curves))
        curves[name] = stated(curve)
    gains = {(e.name, n.key) for e in problem.compiled.model.effects for n in e.gains}
    of_curves = set(vehicle.effect_numbers) - set(vehicle.effects)
    for effect, numbers in sizes.items():
        if effect in of_curves:
            continue
        effects[effect] = {
            **effects.get(effect, {}),
            **{key: f.value for key, f in numbers.items()},
        }
        spreads[effect] = {
            key: f.std for key, f in numbers.items() if (effect, key) in gains and 0.0 < f.std < inf
        }
    used = {effect for effect in effects if effect not in vehicle.machine.effects}
    for path in own:
        if used & set(effects_of_file(path)):
            files.append(path.resolve())
    extended = replace(
        vehicle,
        effects=effects,
        effects_spread=spreads,
        effects_files=tuple(files),
        curves=curves,
    )
    return extended, name


def stated(curve: Curve) -> ErrorCurve:
    """A curve as a vehicle file states it; over time, it is another one in another drive and its
    covariance says nothing."""
    covariance = () if curve.covariate == TIME else matrix(curve.off.T @ curve.off)
    return ErrorCurve(
        curve.error_term,
        curve.covariate,
        rounded(curve.at),
        rounded(curve.coefficients),
        covariance,
    )


def can_be_stated(curve: Curve, machine: Machine, model: Model) -> bool:
    """Whether the equations know what the curve depends on: those of a ``model`` with the effects
    of a search, and the machine's own."""
    term = machine.error_terms[curve.error_term]
    return all(
        curve.covariate in covariates_of_curve(term, machine, each) for each in (model, None)
    )


def _corrected_curves(vehicle: Vehicle, sizes: Sizes) -> dict[str, ErrorCurve]:
    """The vehicle's curves with their deviations of these ``sizes``."""
    curves = dict(vehicle.curves)
    terms = vehicle.machine.error_terms
    for name, curve in vehicle.curves.items():
        timing = terms[curve.error_term].late is not None
        keys = [
            (effect, key)
            for effect, spreads in numbers_of(name, curve, timing)[1].items()
            for key in spreads
        ]
        known = [sizes[effect][key] for effect, key in keys if key in sizes.get(effect, {})]
        if known:
            by, std = (np.array([getattr(f, part) for f in known]) for part in ("value", "std"))
            curves[name] = curve.shifted(by, std)
    return curves


def corrected(search: Search, h: CauseSet, theta: Floats) -> dict[str, dict[str, Size]]:
    """Numbers that the vehicle file states, but not exactly, as they are estimated beside the
    causes of a set, ``theta`` (m): their sizes hold beside no others."""
    problem = search.problem
    numbers, free = problem.vehicle.effect_numbers, search.free(h.causes)
    wanted = {
        int(i): t for i in problem.nuisances if isinstance(t := problem.thetas[i], StatedGain)
    }
    if not wanted:
        return {}
    fit = search.objective.linearise_at(h.fit.theta, h.fit.shapes)
    variance = np.diag(covariance(search.objective, fit, free))
    least = {(e.name, n.key): n.least for e in problem.compiled.model.effects for n in e.gains}
    sizes: dict[str, dict[str, Size]] = {}
    for i, t in wanted.items():
        value = numbers[t.effect].get(t.key, 0.0) + float(theta[i] * t.unit)
        std = float(np.sqrt(variance[free == i][0]) * t.unit)
        sizes.setdefault(t.effect, {})[t.key] = Size(max(value, least[t.effect, t.key]), std)
    return sizes
