"""The table of log formats: every module or package here is one, and its ``FORMAT`` the entry."""

from __future__ import annotations

import pkgutil
from functools import cache
from importlib import import_module

from clutchest.can.log_format import LogFormat


@cache
def log_formats() -> tuple[LogFormat, ...]:
    """All entries, by suffix; formats that cannot be written come last."""
    names = [module.name for module in pkgutil.iter_modules(__path__)]
    entries = [import_module(f"{__name__}.{name}").FORMAT for name in names]
    return tuple(sorted(entries, key=lambda entry: (not entry.writable, entry.suffix)))
