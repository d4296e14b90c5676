"""Rerun without the half of it that a recording does not need.

Rerun loads a module for everything that it can show or store: five hundred, which takes longer
than to replay a short log.  Its packages hardly do more than hand on what these modules define.
Here a module is loaded when a name of it is asked for.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Sequence
from importlib import import_module
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from importlib.util import resolve_name
from types import ModuleType
from typing import Any

_LIBRARY = "rerun"


class _Finder:
    """Has the packages of the library loaded by :class:`_Loader`."""

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if name.split(".")[0] != _LIBRARY:
            return None
        spec = PathFinder.find_spec(name, path)
        if spec and spec.submodule_search_locations and isinstance(spec.loader, SourceFileLoader):
            spec.loader = _Loader(name, spec.loader.path)
        return spec


class _Loader(SourceFileLoader):
    """Loads a package but for what it only hands on."""

    def exec_module(self, module: ModuleType) -> None:
        tree = ast.parse(self.get_data(self.path))
        waiting = _taken_out(tree, module.__name__)
        exec(compile(tree, self.path, "exec", dont_inherit=True), module.__dict__)
        own = module.__dict__.get("__getattr__")

        def handed_on(name: str) -> Any:
            if name in waiting:
                source, of = waiting[name]
                found = import_module(source)
                value = getattr(found, of) if of else found
            elif own:
                return own(name)
            else:
                raise AttributeError(f"module '{module.__name__}' has no attribute '{name}'")
            setattr(module, name, value)
            return value

        module.__getattr__ = handed_on  # type: ignore[method-assign]


def _taken_out(tree: ast.Module, package: str) -> dict[str, tuple[str, str]]:
    """Takes the imports of its own modules out of a package whose names it does not use itself;
    returns module and name there, "" for the module itself, by the name in the package."""
    used = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    waiting: dict[str, tuple[str, str]] = {}
    body: list[ast.stmt] = []
    for node in tree.body:
        if isinstance(node, ast.ImportFrom) and node.level:
            source = resolve_name("." * node.level + (node.module or ""), package)
            for alias in node.names:
                name = alias.asname or alias.name
                if name not in used:
                    here = (source, alias.name) if node.module else (f"{source}.{alias.name}", "")
                    waiting[name] = here
            node.names = [alias for alias in node.names if (alias.asname or alias.name) in used]
            if not node.names:
                continue
        body.append(node)
    tree.body = body
    return waiting


def lighten_rerun() -> None:
    """For the rest of the process: for a program, not for a library."""
    sys.meta_path.insert(0, _Finder())
