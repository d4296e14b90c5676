"""Packages that are called by their own name: ``clutchest.fleet(…)``.

A package and a function of one name would hide each other, whichever is imported last.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib import import_module
from inspect import Signature, signature
from types import ModuleType
from typing import Any


class _CallableRoom(ModuleType):
    """A package that hands calls on to one of its functions, which is loaded for it."""

    _calls: tuple[str, str]

    @property
    def _function(self) -> Callable[..., Any]:
        module, function = self._calls
        called: Callable[..., Any] = getattr(import_module(module), function)
        return called

    @property
    def __signature__(self) -> Signature:
        return signature(self._function)

    def __call__(self, *given: Any, **named: Any) -> Any:
        return self._function(*given, **named)


def call_by(package: str, module: str, function: str) -> None:
    """Have a ``package`` that is being imported called as this ``function``."""
    room = sys.modules[package]
    room.__class__ = _CallableRoom
    room._calls = module, function  # type: ignore[attr-defined]
