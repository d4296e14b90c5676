"""Loading libraries while a log is filtered, without holding the filter up.

Python runs one thread at a time.  A library of hundreds of modules, loaded in a thread of its own,
takes turns with what must happen between two calls of compiled code, which then comes late; loaded
module by module, and only while compiled code runs, it hardly holds the filter up.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from importlib.machinery import ModuleSpec
from threading import Event, Lock, get_ident
from types import ModuleType

# Then a module is loaded all the same: while one is searched for no other thread can load any, and
# whoever works may need this one.
PATIENCE_S = 0.005

_lock = Lock()
_idle = Event()
_idle.set()
_working = 0  # threads that run Python which loading must not hold up


@contextmanager
def at_work() -> Iterator[None]:
    """Patient loading waits while this thread is in here."""
    _count(1)
    try:
        yield
    finally:
        _count(-1)


@contextmanager
def in_compiled_code() -> Iterator[None]:
    """A part of :func:`at_work` in which Python is left alone."""
    _count(-1)
    try:
        yield
    finally:
        _count(1)


def load_patiently(modules: Iterable[str]) -> None:
    """Load ``modules`` and what they need in this thread, one by one, while nobody is at work."""
    patience = _Patience(get_ident())
    sys.meta_path.insert(0, patience)
    try:
        for module in modules:
            import_module(module)
    finally:
        sys.meta_path.remove(patience)


def _count(change: int) -> None:
    global _working
    with _lock:
        _working += change
        if _working > 0:
            _idle.clear()
        else:
            _idle.set()


class _Patience:
    """Finds no module, but lets a ``thread`` that searches for one wait."""

    def __init__(self, thread: int) -> None:
        self._thread = thread

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if get_ident() == self._thread:
            _idle.wait(PATIENCE_S)
        return None
