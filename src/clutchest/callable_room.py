"""Packages that are called by their own name: ``clutchest.fleet(…)``.

A package and a function of one name would hide each other, whichever is imported last.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import Any


class _CallableRoom(ModuleType):
    """A package that hands calls on to one of its functions, which is loaded for it."""

    _calls: tuple[str, str]

    def __call__(self, *given: Any, **named: Any) -> Any:
        module, function = self._calls
        return getattr(import_module(module), function)(*given, **named)


def call_by(package: str, module: str, function: str) -> None:
    """Have a ``package`` that is being imported called as this ``function``."""
    room = sys.modules[package]
    room.__class__ = _CallableRoom
    room._calls = module, function  # type: ignore[attr-defined]
