"""A user's own Python file, loaded as a module."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from traceback import extract_tb
from types import ModuleType

from clutchest.errors import ClutchestError, file_like


def load_module(path: Path, name: str, expected: str) -> ModuleType:
    """The file at ``path`` as the module ``name``.  ``expected``: what it should define, in words.

    Raises ClutchestError naming file and line where it cannot be read or run.
    """
    if not path.is_file():
        raise ClutchestError(f"{path}: no such file{file_like(path)}")
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ClutchestError(f"{path}: expected a Python file (.py) with {expected}")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # where dataclasses look up annotations
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:  # the user's code may raise anything
        raise ClutchestError(f"{path}:{_line(error, path)} {_words(error)}") from error
    return module


def _line(error: BaseException, path: Path) -> str:
    """``"12:"`` for the line of the file at which ``error`` was raised, empty if unknown."""
    if isinstance(error, SyntaxError):
        return f"{error.lineno}:" if error.lineno else ""
    own = str(path.absolute())
    lines = [frame.lineno for frame in extract_tb(error.__traceback__) if frame.filename == own]
    return f"{lines[-1]}:" if lines else ""


def _words(error: BaseException) -> str:
    """``error`` in one line; a ClutchestError is already one."""
    if isinstance(error, ClutchestError):
        return str(error)
    text = error.msg if isinstance(error, SyntaxError) else str(error)
    return f"{type(error).__name__}: {' '.join(text.split())}"
