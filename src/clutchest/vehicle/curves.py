"""Curves of a vehicle file: ``[effects.curve_1]`` with error term, covariate, knots and values."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from clutchest.errors import nearest
from clutchest.models.error_curve import ErrorCurve, free_name, is_curve
from clutchest.vehicle.earlier_patch import EarlierPatch
from clutchest.vehicle.toml import Keys, TomlFile

if TYPE_CHECKING:
    from clutchest.models.machine import Machine

PATCH = "a patch of an earlier version, read as a curve"

_KEYS = ("error_term", "covariate", "knots", "values", "covariance")
_ASYMMETRY = 1e-6  # of the largest variance: what rounding makes of a covariance


def read_curves(
    file: TomlFile, machine: Machine, patches: Mapping[Path, EarlierPatch]
) -> dict[str, ErrorCurve]:
    """The curves that a vehicle file states, and those of ``patches`` of an earlier version, which
    are read as curves.  Raises ClutchestError with file and line."""
    table = file.table(("effects",), file.data.get("effects", {}))
    spreads = file.table(("effects_spread",), file.data.get("effects_spread", {}))
    curves = {
        name: _curve(file, ("effects", name), entry, machine)
        for name, entry in table.items()
        if is_curve(name)
    }
    for patch in patches.values():
        if any(name in table for name in patch.effects):
            curves[free_name(tuple(curves))] = patch.curve(file, table, spreads, machine)
    return curves


def _curve(file: TomlFile, at: Keys, value: Any, machine: Machine) -> ErrorCurve:
    entry = file.table(at, value)
    file.known(at, entry, _KEYS, "key of a curve")
    for key in _KEYS[:-1]:
        if key not in entry:
            raise file.error(at, f"{'.'.join(at)} has no '{key}'")
    term, covariate = (file.string((*at, key), entry[key]) for key in ("error_term", "covariate"))
    _check_covariate(file, at, term, covariate, machine)
    knots, values = (_numbers(file, (*at, key), entry[key]) for key in ("knots", "values"))
    if len(knots) < 2 or any(a >= b for a, b in pairwise(knots)):
        raise file.error(
            (*at, "knots"), f"{'.'.join(at)}.knots must be two or more numbers that increase"
        )
    if len(values) != len(knots):
        raise file.error(
            (*at, "values"),
            f"{'.'.join(at)}.values has {len(values)} numbers, expected one per knot, {len(knots)}",
        )
    covariance = _covariance(file, (*at, "covariance"), entry.get("covariance", []), len(knots))
    return ErrorCurve(term, covariate, knots, values, covariance)


def _check_covariate(file: TomlFile, at: Keys, term: str, covariate: str, machine: Machine) -> None:
    terms = machine.error_terms
    if term not in terms:
        raise file.error(
            (*at, "error_term"),
            f"unknown error term '{term}' of '{machine.name}'" + nearest(term, terms),
        )
    from clutchest.models.curve_effect import covariates_of_curve

    known = covariates_of_curve(terms[term], machine)
    if covariate not in known:
        raise file.error(
            (*at, "covariate"),
            f"unknown covariate '{covariate}' of the error term '{term}'"
            + nearest(covariate, known),
        )


def _numbers(file: TomlFile, keys: Keys, value: Any) -> tuple[float, ...]:
    if not isinstance(value, list):
        raise file.error(keys, f"{'.'.join(keys)} must be a list of numbers, not {value!r}")
    return tuple(file.number(keys, item) for item in value)


def _covariance(file: TomlFile, keys: Keys, value: Any, n: int) -> tuple[tuple[float, ...], ...]:
    if not isinstance(value, list):
        raise file.error(keys, f"{'.'.join(keys)} must be a list of {n} rows, not {value!r}")
    if not value:
        return ()
    rows = tuple(_numbers(file, keys, row) for row in value)
    if len(rows) != n or any(len(row) != n for row in rows):
        raise file.error(keys, f"{'.'.join(keys)} must have {n} rows of {n} numbers")
    matrix = np.array(rows)
    tolerance = _ASYMMETRY * np.abs(matrix).max()
    if np.abs(matrix - matrix.T).max() > tolerance:
        raise file.error(keys, f"{'.'.join(keys)} must be symmetric")
    if np.linalg.eigvalsh(matrix).min() < -tolerance:
        raise file.error(keys, f"{'.'.join(keys)} must be positive semidefinite")
    return rows
