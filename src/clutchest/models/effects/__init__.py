"""What an effect is, and effects from the files of a package or of a user."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import MappingProxyType, ModuleType

from clutchest.errors import ClutchestError
from clutchest.models.effects.declared import made
from clutchest.models.effects.effect import (
    RESERVED,
    Effect,
    Gains,
    Lateness,
    Number,
    Wording,
)
from clutchest.models.python_file import load_module

NO_DIGESTS: Mapping[Path, str] = MappingProxyType({})

__all__ = [
    "Effect",
    "Gains",
    "Lateness",
    "Number",
    "Wording",
    "effects_in",
    "effects_of_file",
    "with_files",
]


def effects_in(package: str) -> Mapping[str, Effect]:
    """Name → effect, for every file of a package that has one effect per file."""
    folder = importlib.import_module(package)
    modules = [info.name for info in pkgutil.iter_modules(folder.__path__)]
    loaded = [importlib.import_module(f"{package}.{name}") for name in modules]
    made_here = [kind() for module in loaded for kind in _defined_in(module)]
    effects = {effect.name: effect for effect in made_here}
    return MappingProxyType(dict(sorted(effects.items())))


def effects_of_file(path: Path, digest: str = "") -> Mapping[str, Effect]:
    """Name → effect, for every effect class in a user's own Python file, with the content of that
    ``digest`` if one is given.

    Raises ClutchestError where the file cannot be read, defines none, or one that is incomplete.
    """
    module = load_module(path, f"clutchest_effects_{path.stem}", "effects", digest)
    effects = {effect.name: effect for effect in (made(c, path) for c in _defined_in(module))}
    if not effects:
        raise ClutchestError(f"{path}: expected a subclass of clutchest.machine.Effect")
    for name in (name for name in effects if name in RESERVED):
        raise ClutchestError(f"{path}: effect '{name}' has a reserved name, expected another")
    return effects


def with_files(
    library: Mapping[str, Effect], files: Iterable[Path], digests: Mapping[Path, str] = NO_DIGESTS
) -> dict[str, Effect]:
    """Name → effect, of a machine's ``library`` and of a user's own ``files``; ``digests`` of the
    contents that some of them must have.  Raises as :func:`effects_of_file` does."""
    known = dict(library)
    for path in files:
        known |= effects_of_file(path, digests.get(path, ""))
    return known


def _defined_in(module: ModuleType) -> list[type[Effect]]:
    return [
        value
        for value in vars(module).values()
        if inspect.isclass(value)
        and issubclass(value, Effect)
        and value is not Effect
        and value.__module__ == module.__name__
    ]
