"""What an effect is, and effects from the files of a package or of a user."""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import pkgutil
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType, ModuleType

from clutchest.errors import ClutchestError, file_like
from clutchest.models.effects.effect import Effect, Gains, Lateness, Number

__all__ = ["Effect", "Gains", "Lateness", "Number", "effects_in", "effects_of_file"]


def effects_in(package: str) -> Mapping[str, Effect]:
    """Name → effect, for every file of a package that has one effect per file."""
    folder = importlib.import_module(package)
    modules = [info.name for info in pkgutil.iter_modules(folder.__path__)]
    loaded = [importlib.import_module(f"{package}.{name}") for name in modules]
    effects = {effect.name: effect for module in loaded for effect in _defined_in(module)}
    return MappingProxyType(dict(sorted(effects.items())))


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
