"""The models that vehicle files can name."""

from __future__ import annotations

import importlib
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from clutchest.errors import ClutchestError, nearest
from clutchest.models.error_terms import ErrorTerm
from clutchest.models.symbols import Input, Parameter, Sensor, State

if TYPE_CHECKING:
    from clutchest.models.model import Model

_MODELS = ("dry_clutch", "alsd")  # each a module of this package


@dataclass(frozen=True, slots=True)
class ModelCard:
    """What a vehicle file may say of a model, without loading its equations' machinery."""

    name: str
    states: tuple[State, ...]
    parameters: tuple[Parameter, ...]
    inputs: tuple[Input, ...]
    sensors: tuple[Sensor, ...]
    columns: tuple[tuple[str, str], ...]  # canonical (name, unit) that a vehicle may map
    apart: tuple[tuple[tuple[str, str], str], ...]  # two states, what tells them apart


def _module(model: str) -> Any:
    if model not in _MODELS:
        raise ClutchestError(f"unknown model '{model}'" + nearest(model, _MODELS))
    return importlib.import_module(f"{__name__}.{model}")


def card(model: str) -> ModelCard:
    """The card of a model by its name.  Raises ClutchestError for an unknown one."""
    module = _module(model)
    return ModelCard(
        model,
        module.STATES,
        module.PARAMETERS,
        module.INPUTS,
        module.SENSORS,
        module.COLUMNS,
        module.APART,
    )


def only_for(known: str, model: str, what: str) -> None:
    """Raises ClutchestError where ``what`` is there for another model than this one."""
    if model != known:
        raise ClutchestError(f"{what} is there for '{known}' only, not for '{model}'")


def model_for(name: str, signals: Container[str]) -> Model:
    """The equations of the model ``name`` in the form that these canonical signals can drive."""
    return _module(name).for_signals(signals)


def resting(
    name: str, parameters: Mapping[str, float], inputs: Mapping[str, float]
) -> dict[str, float]:
    """State values of a clutch at rest at the start of a drive, as far as the model can tell."""
    return _module(name).resting(parameters, inputs)


def error_terms_of(name: str) -> Mapping[str, ErrorTerm]:
    """Name → a way in which an equation of the model may be wrong that no effect knows."""
    error_terms: Mapping[str, ErrorTerm] = _module(name).ERROR_TERMS
    return error_terms


def covariates_of(name: str) -> tuple[tuple[str, ...], Mapping[str, str]]:
    """Quantities that an error may go with, and rates of inputs: name → input."""
    module = _module(name)
    return module.DRIVERS, module.RATES


def peaks_of(name: str) -> Mapping[str, str]:
    """Memories that an error may go with: name → the state whose highest value so far it is."""
    peaks: Mapping[str, str] = _module(name).PEAKS
    return peaks


def told_apart_by(name: str, equations: Sequence[str]) -> str:
    """The sensor that would tell errors in these equations apart."""
    for pair, sensor in _module(name).TOLD_APART_BY:
        if set(pair) <= set(equations):
            return str(sensor)
    alone = _module(name).TOLD_BY
    kinds = dict.fromkeys(alone.get(equation, alone[""]) for equation in equations)
    return " or ".join(kinds)
