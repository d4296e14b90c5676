"""The models that vehicle files can name."""

from __future__ import annotations

from dataclasses import dataclass

from clutchest.errors import ClutchestError, nearest
from clutchest.models.symbols import Input, Parameter, Sensor, State

_MODELS = ("dry_clutch",)


@dataclass(frozen=True, slots=True)
class ModelCard:
    """What a vehicle file may say of a model, without loading its equations' machinery."""

    name: str
    states: tuple[State, ...]
    parameters: tuple[Parameter, ...]
    inputs: tuple[Input, ...]
    sensors: tuple[Sensor, ...]
    columns: tuple[tuple[str, str], ...]  # canonical (name, unit) that a vehicle may map


def card(model: str) -> ModelCard:
    """The card of a model by its name.  Raises ClutchestError for an unknown one."""
    if model not in _MODELS:
        raise ClutchestError(f"unknown model '{model}'" + nearest(model, _MODELS))
    from clutchest.models import dry_clutch as module

    return ModelCard(
        model, module.STATES, module.PARAMETERS, module.INPUTS, module.SENSORS, module.COLUMNS
    )
