"""A user's own Python file, run as a module: the bytes that were read, and no others."""

from __future__ import annotations

import sys
from hashlib import sha256
from pathlib import Path
from traceback import extract_tb
from types import CodeType, ModuleType
from warnings import catch_warnings

from clutchest.errors import ClutchestError, file_like


def digest_of(path: Path) -> str:
    """Which content a user's own Python file has.  Raises ClutchestError where there is no file."""
    return sha256(_read(path)).hexdigest()


def check_syntax(path: Path) -> None:
    """Raises ClutchestError naming file and line where the file is no Python; it is not run."""
    try:
        with catch_warnings(action="ignore"):
            _compiled(path, _read(path))
    except (SyntaxError, ValueError) as error:  # the latter for a null byte, of older Pythons
        raise _failed(path, error) from error


def load_module(path: Path, name: str, expected: str, digest: str = "") -> ModuleType:
    """The file at ``path`` as the module ``name``.  ``expected``: what it should define, in words.

    Only source is run, compiled from the bytes that were read, never a ``.pyc`` beside it; with
    ``digest`` only if these bytes are the ones that it is of.  Raises ClutchestError naming file
    and line where it cannot be read or run, whatever the file raises.
    """
    if path.suffix != ".py":
        raise ClutchestError(f"{path}: expected a Python file (.py) with {expected}")
    source = _read(path)
    if digest and sha256(source).hexdigest() != digest:
        raise ClutchestError(f"{path}: was changed after its vehicle was loaded")
    module = ModuleType(name)
    module.__file__ = str(path)
    sys.modules[name] = module  # where dataclasses look up annotations
    try:
        with catch_warnings(action="ignore"):  # of its syntax and its imports: not ours to print
            exec(_compiled(path, source), module.__dict__)
    except BaseException as error:  # the user's code may raise anything, SystemExit too
        raise _failed(path, error) from error
    return module


def _compiled(path: Path, source: bytes) -> CodeType:
    return compile(source, str(path.absolute()), "exec", dont_inherit=True)


def _failed(path: Path, error: BaseException) -> ClutchestError:
    return ClutchestError(f"{path}:{_line(error, path)} {_words(error)}")


def _read(path: Path) -> bytes:
    if not path.is_file():
        raise ClutchestError(f"{path}: no such file{file_like(path)}")
    return path.read_bytes()


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
