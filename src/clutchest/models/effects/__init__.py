"""The library of effects: one file per effect, in one folder per model."""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import pkgutil
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType, ModuleType

from clutchest.errors import ClutchestError, file_like, nearest
from clutchest.models.effects.effect import Effect, Gains, Lateness, Number

__all__ = ["Effect", "Gains", "Lateness", "Number", "effects_of_file", "library"]


@cache
def library(model: str) -> Mapping[str, Effect]:
    """Name → effect, for every file in this model's folder.

    Raises ClutchestError for a model that has no effects.
    """
    folders = {m.name for m in pkgutil.iter_modules(__path__) if m.ispkg}
    if model not in folders:
        raise ClutchestError(f"no effects for model '{model}'" + nearest(model, folders))
    package = importlib.import_module(f"{__name__}.{model}")
    found: dict[str, Effect] = {}
    for info in pkgutil.iter_modules(package.__path__):
        module = importlib.import_module(f"{package.__name__}.{info.name}")
        found |= {effect.name: effect for effect in _defined_in(module)}
    return MappingProxyType(dict(sorted(found.items())))


def effects_of_file(path: Path) -> Mapping[str, Effect]:
    """Name → effect, for every effect class in a user's own Python file.

    Raises ClutchestError where the file cannot be read or defines none.
    """
    spec = importlib.util.spec_from_file_location(f"clutchest_effects_{path.stem}", path)
    if not path.is_file():
        raise ClutchestError(f"{path}: no such file of effects" + file_like(path))
    if spec is None or spec.loader is None:
        raise ClutchestError(f"{path}: expected a Python file (.py) with effects")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:  # whatever the user's file does wrong
        raise ClutchestError(f"{path}: {type(error).__name__}: {error}") from error
    found = {effect.name: effect for effect in _defined_in(module)}
    if not found:
        raise ClutchestError(f"{path}: expected a subclass of clutchest.models.effects.Effect")
    return found


def _defined_in(module: ModuleType) -> list[Effect]:
    return [
        value()
        for value in vars(module).values()
        if inspect.isclass(value)
        and issubclass(value, Effect)
        and value is not Effect
        and value.__module__ == module.__name__
    ]
